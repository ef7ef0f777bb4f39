"""Patterns of :mod:`.text_reader` for actions, orientations, distances, bodies and scenes.

The order of a table matters: later patterns skip words that earlier ones have read.
"""

# A table of patterns reads best with one phrase to a line.
# ruff: noqa: E501, ISC004

from __future__ import annotations

_STOP = (
    r"(?!(?:from|off|at|in|on|to|up|with|while|who|and|or|then|towards?|facing|slowly|quickly|fast|several|"
    r"once|twice|away|of)\b)"
)
_THING = rf"{_STOP}[a-z]+(?: {_STOP}[a-z]+){{0,3}}"
_FLOOR = r"(?:up )?(?:from|off)(?: of)? the (?:floor|ground)"
_RADAR = r"<a>(?:radar|sensor|camera|device|antenna)"
_SIDE = r"(?:(?P<side>left|right) )?"
_ARM, _LEG = r"(?:arm|hand)", r"(?:leg|foot|knee)"
_UP = r"(?:up(?: high)?|high|upwards?|overhead|aloft|raised|lifted|in the air|into the air|(?:above|over) <a>head)"
_HELD = r"(?:<hold|held>|<put>|<stretch>|<keep|kept>|<throw|threw>)"
_RAISE = r"(?:<raise>|<lift>)"
_RAISES = r"(?:raises?|raising|lifts?|lifting)(?! (?:up )?(?:an?|the|his|her|their|its|my|your|one|both|two|left|right|arms?|hands?|legs?)\b)"
"""Noun, as in "a left arm raise", without an object."""
_LEFT_AND_RIGHT = (
    rf"<a>(?:left (?:{_ARM} )?and (?:also )?<a>right|right (?:{_ARM} )?and (?:also )?<a>left) (?:arms?|hands?)"
)
_ARMS = rf"(?:(?:(?:both|two) (?:of )?)?<a>(?:arms|hands)|{_LEFT_AND_RIGHT})"
_SIDEWAYS = r"(?:sideways|to (?:the|both|either|his|her|their) sides?)"
_HAND = r"(?:with )?<a>(?:(?P<side>left|right) )?(?:open )?(?:hand|arm|palm|index finger|finger)"
_GESTURE = r"(?:gesture|motion|movement)s?"
TO_AND_FRO = (
    r"(?:back and forth|back and forwards?|to and fro|up and down|forwards? and backwards?|forth and back"
    rf"|backwards? and forwards?|forwards? and then back(?:wards?)?"
    rf"|towards? and away from {_RADAR}|(?:(?:towards?|up to|to) {_RADAR}|away(?: from {_RADAR})?) and (?:then )?"
    rf"(?:(?:<walk>|<go|went>|<come|came>|<move>) )?(?:back|away(?: from (?:it|{_RADAR}))?)(?: again)?)"
)
"""Both ways, one after the other."""
_WALK = r"(?:<walk>|<stroll>|<pace>|<stride|strode>|<march>)"
_GO = r"(?:<go|went>|<move>|<come|came>|<step>|<head>)"
_ADVERBS = r"(?: (?:[a-z]+ly|very|quite|rather|fast|,))*?"
_STRAIGHT = r"(?:(?:straight|right|directly|forwards?|ahead) )*"
_OWN = r"(?:to )?<a>(?:own )?"
_NOT_LIMB = r"(?:wards?)?(?: side)?(?! (?:arm|hand|leg|foot|and|or|to)\b)"
_AWAY = rf"away(?: from {_RADAR})?"
_AIR = r"(?:in|into) (?:the )?(?:mid ?)?air"
_TURN = r"(?:clockwise|counter ?clockwise|anti ?clockwise)"
_DIRECTION = r"(?:(?:from )?<a>(?:left|right) )?(?:to |towards? )?(?:the |<a>own )?(?P<direction>left|right)(?:wards?)?(?: side)?"

ACTION_PATTERNS: tuple[tuple[str, str], ...] = (
    ("jumping_jacks", r"(?:jumping ?jacks?|star ?jumps?|side straddle hops?)"),
    ("t_pose", r"(?:(?:in|<hold|held>|<strike|struck>|<make|made>) )?<a>t ?(?:pose|posing|poses|shape|stance|position)"),
    ("y_pose", r"(?:(?:in|<hold|held>|<strike|struck>|<make|made>) )?<a>y ?(?:pose|posing|poses|shape|stance|position)"),
    ("t_pose", rf"(?:<spread>|<stretch>|<extend>) (?:out )?{_ARMS}(?: (?:out|wide|apart))*(?: {_SIDEWAYS})?"),
    ("t_pose", rf"{_ARMS} (?:are )?(?:(?:(?:held|stretched|spread|extended) )?(?:out|wide|apart)|outstretched|spread)"
               rf"(?: wide)?(?: {_SIDEWAYS})?"),
    ("t_pose", rf"{_ARMS} (?:are )?(?:held|stretched|extended|raised) {_SIDEWAYS}"),
    ("y_pose", rf"{_RAISE} (?:up )?{_ARMS}(?: {_UP})?"),
    ("y_pose", rf"{_HELD} (?:up )?{_ARMS} {_UP}|{_HELD} up {_ARMS}"),
    ("y_pose", rf"{_ARMS} (?:are )?(?:being )?(?:(?:held|stretched) )?{_UP}|raised {_ARMS}"),
    ("{side}_arm_raised", rf"{_RAISE} (?:up )?<a>{_SIDE}{_ARM}(?: {_UP})?"),
    ("{side}_arm_raised", rf"{_HELD} <a>{_SIDE}{_ARM} {_UP}"),
    ("{side}_arm_raised", rf"{_HELD} up <a>{_SIDE}{_ARM}"),
    ("{side}_arm_raised", rf"<a>{_SIDE}{_ARM} (?:is )?(?:being )?(?:(?:held|stretched) )?{_UP}"),
    ("{side}_arm_raised", rf"<a>{_SIDE}{_ARM} {_RAISES}"),
    ("{side}_arm_raised", rf"(?:raise|raising|lift|lifting) of <a>{_SIDE}{_ARM}"),
    ("{side}_leg_raised", rf"{_RAISE} (?:up )?<a>{_SIDE}{_LEG}(?: {_UP})?"),
    ("{side}_leg_raised", rf"{_HELD} <a>{_SIDE}{_LEG} {_UP}"),
    ("{side}_leg_raised", rf"{_HELD} up <a>{_SIDE}{_LEG}"),
    ("{side}_leg_raised", rf"<a>{_SIDE}{_LEG} (?:is )?(?:being )?(?:(?:held|stretched) )?{_UP}"),
    ("{side}_leg_raised", rf"<a>{_SIDE}{_LEG} {_RAISES}"),
    ("{side}_leg_raised", rf"(?:raise|raising|lift|lifting) of <a>{_SIDE}{_LEG}"),
    ("{other}_leg_raised", rf"(?:<stand|stood>|<balance>) (?:only )?on (?:only )?<a>{_SIDE}{_LEG}(?: only)?"
                           rf"(?: , (?:the )?(?P<side2>left|right) (?:one|{_LEG}))?"),
    ("finger_swing", r"(?:<swing|swung>|<wag>|<wiggle>|<wave>) <a>(?:(?P<side>left|right) )?(?:index )?fingers?"
                     rf"(?: {TO_AND_FRO}| (?:from )?side to side| (?:from )?(?:left (?:and|to) right|right (?:and|to) left))?"),
    ("finger_swing", rf"(?:index )?finger ?(?:<swing|swung>|<wag>|<wiggle>)(?: {_GESTURE})?"),
    ("circle_{turn}", rf"(?:(?:<draw|drew|drawn>|<trace>|<make|made>|<describe>|<do|does|did>|<perform>|<paint>) )?"
                      rf"(?<!in )(?<!in a )<a>(?:(?P<turn>{_TURN}) )?(?:circular {_GESTURE}|<circle>(?: {_GESTURE})?)"
                      rf"(?: {_HAND})?(?: {_AIR})?(?: (?P<turn2>{_TURN}))?"),
    ("circle_{turn}", rf"(?:<rotate>|<move>|<turn>|<spin|spun>) {_HAND} (?:in circles |in a circle |around )?(?P<turn>{_TURN})"),
    ("circle_{turn}", rf"<move> {_HAND} in (?:a circle|circles)"),
    ("swipe_{direction}", rf"(?P<direction>left|right)(?:wards?)? (?:swipes?|swiping|sweeps?)(?: {_GESTURE})?"),
    ("swipe_{direction}", rf"(?:<swipe>|<sweep|swept>)(?: {_HAND})?(?: {_GESTURE})?(?: {_DIRECTION})?"),
    ("push", rf"<push>(?! ?ups?\b)(?: {_GESTURE})?(?: {_HAND}| {_ARMS})?"
             rf"(?: (?:forwards?|outwards?|out|away|ahead))?(?: (?:towards?|at) {_RADAR})?"),
    ("pull", rf"<pull>(?! ?ups?\b)(?: {_GESTURE})?(?: {_HAND}| {_ARMS})?(?: (?:backwards?|back|inwards?|in))?"
             rf"(?: (?:away from {_RADAR}|towards? (?:<a>(?:body|chest)|himself|herself|themsel(?:f|ves)|oneself)))?"),
    ("click", rf"(?:<click>|<tap>)(?: {_GESTURE})?(?: {_HAND})?(?: {_AIR})?"),
    ("click", rf"<press>(?: down)?(?: on)? <a>(?:(?:virtual|invisible|imaginary) )?button(?: {_AIR})?"),
    ("pick_up", r"(?:(?:<bend|bent>|<crouch>|<stoop>|<squat>|<kneel|knelt>)(?: down| over)?(?: and| to)? )?"
                rf"(?:<pick> {_THING} up|(?:<pick> ?up|pickup)(?! speed)(?: {_THING})?|<lift> {_THING} up"
                rf"|(?:<grab>|<collect>|<lift>|<take|took|taken>|<retrieve>|<fetch>|<pick>) (?:up )?{_THING}(?= {_FLOOR}))"
                rf"(?: {_FLOOR})?"),
    ("walk", rf"(?:{_WALK}|{_GO}) {TO_AND_FRO}|{_WALK} (?:around|about)"),
    ("walk_straight", rf"(?:{_WALK}|{_GO})(?= (?P<to>back (?:to|towards?) {_RADAR}))"),
    ("walk_straight", rf"(?:{_WALK}|{_GO})(?={_ADVERBS} (?:(?P<to>{_STRAIGHT}(?:(?:towards?|up to|to) {_RADAR}|closer(?: to {_RADAR})?))"
                      rf"|(?P<away>{_STRAIGHT}{_AWAY})))"),
    ("walk_straight", rf"<approach>(?= (?P<to>{_RADAR}))"),
    ("walk_straight", rf"{_WALK}(?={_ADVERBS} (?:(?P<left>{_OWN}left{_NOT_LIMB})|(?P<right>{_OWN}right{_NOT_LIMB})))"),
    ("walk_straight", rf"{_WALK}(?={_ADVERBS} (?P<ahead>straight(?: ahead| on| forwards?)?|forwards?|ahead|in a straight line)(?! and\b))"),
    ("walk", rf"{_WALK}(?! backwards?\b)"),
    ("jump", r"(?:<jump>|<hop>|<leap|leapt>)(?! ?rop)"
             r"(?: (?:up and down|up|in place|on the spot|(?:high )?(?:in|into) the air|high))*"),
    # Last, since other actions include standing.
    ("standing", r"(?:<stand|stood>|<stay>|<remain>|<keep|kept>|<wait>)(?! up)"
                 r"(?: (?:still|upright|motionless|straight|idle|there|quietly|calmly))*|still|motionless|idle|idling"),
)  # fmt: skip
"""(action, pattern). Groups of the match fill `{side}`, `{other}` (the other side), `{direction}` and `{turn}`; missing
groups leave both options open."""

ORIENTATION_PATTERNS: tuple[tuple[float, str], ...] = (
    (180.0, rf"(?:<face>|<look>|turned|oriented|orientation|moving)(?: directly)? (?:away(?: from {_RADAR})?|backwards?)"),
    (180.0, rf"(?:with )?<a>back (?:is )?(?:turned )?(?:to|towards?|facing) {_RADAR}"),
    (180.0, r"(?:(?:seen|viewed) )?from behind|rear view|back view"),
    (0.0, rf"(?:<face>|<look>|turned|oriented|orientation)(?: directly| straight)? (?:(?:at|to|towards?) )?(?:{_RADAR}|forwards?|<a>front|ahead)"),
    (0.0, rf"(?:directly |straight )?at {_RADAR}|(?:(?:seen|viewed) )?from the front|front view|frontal|(?:face|head) on"),
    (90.0, r"(?:<face>|<look>|turned|oriented|orientation) (?:(?:to|towards?) )?(?:the |<a>own )?left(?:wards?)?|(?:in )?left profile"),
    (270.0, r"(?:<face>|<look>|turned|oriented|orientation) (?:(?:to|towards?) )?(?:the |<a>own )?right(?:wards?)?|(?:in )?right profile"),
    (90.0, rf"(?:<face>|<look>|turned|oriented|orientation) (?:sideways|to the side)|side ?(?:on|ways)(?: (?:to|towards?) {_RADAR})?|side view"
           r"|(?:(?:seen|viewed) )?from the side|in profile|profile view"),
)  # fmt: skip
"""(angle [degrees], pattern): 0 faces the radar, positive turns towards the person's own left."""

TURN_PATTERN = (
    r"(?:(?:<face>|turned|rotated|oriented|<rotate>|<turn>) )?(?:(?:at|by) )?(?:an angle of )?(?P<angle><n>) degrees?"
    r"(?: (?:to (?:the |<a>own )?)?(?P<side>left|right))?(?: (?:to|from) " + _RADAR + ")?"
)
ORIENTATION_NUMBER = r"orientation(?: angle)?(?: of)? (?P<angle><n>)(?! degrees)(?: (?:to the )?(?P<side>left|right))?"

WAYS = {"to": 0.0, "away": 180.0, "left": 90.0, "right": 270.0}
"""Group of a pattern of walking one way -> orientation of the person [degrees]."""
WAY_PATTERNS: tuple[tuple[float, str], ...] = (
    (180.0, rf"(?:directly |straight )?away from {_RADAR}"),
    (0.0, rf"(?:directly |straight )?towards? {_RADAR}"),
)
"""(angle [degrees], pattern) of a walking direction anywhere in the sentence."""

_BORESIGHT = r"(?:<a>(?:radar )?(?:boresight|cent(?:re|er) ?line|(?:optical )?axis)|straight ahead)"

_METRES = r"(?P<unit>m|met(?:re|er)s?|cm|centimet(?:re|er)s?|feet|foot|ft)"
_ABOUT = r"(?:(?:about|around|roughly|approximately|some|ca) )?"
_SIDE_OF = rf"(?: (?:(?:to|on|towards) (?:the |its )?)?(?P<side>left|right)(?: of (?:{_BORESIGHT}|{_RADAR}))?)"
BEARING_PATTERNS: tuple[str, ...] = (
    rf"(?:(?:at|in|with|under|from) )?<a>(?:azimuth|bearing)(?: angle)?(?: of)? {_ABOUT}(?P<angle><n>)(?: degrees?)?{_SIDE_OF}?",
    rf"(?:at )?<a>(?:angle of )?{_ABOUT}(?P<angle><n>) degrees? (?:in |of )?azimuth{_SIDE_OF}?",
    rf"(?:at )?<a>(?:angle of )?{_ABOUT}(?P<angle><n>) degrees? (?:off|from|away from) {_BORESIGHT}{_SIDE_OF}?",
    rf"(?:at )?{_ABOUT}(?P<angle><n>) degrees? (?:(?:to|on) (?:the |its )?)?(?P<side>left|right) of (?:{_BORESIGHT}|{_RADAR})",
)
"""Azimuth of the person from the boresight, positive to the radar's left."""
_LENGTH = rf"{_ABOUT}(?P<value><n>) {_METRES}"
DISTANCE_PATTERNS: tuple[str, ...] = (
    rf"(?:at |from )?<a>(?:distance|range) (?:of )?{_LENGTH}(?: (?:away )?(?:from|to|of) {_RADAR})?",
    rf"(?:at )?{_LENGTH} (?:away(?: from {_RADAR})?|from {_RADAR}|in front of {_RADAR}|distant|distance|off)",
    rf"at {_LENGTH}(?! (?:tall|high|per))",
    r"distance (?P<value><n>)(?= ,|$)",
)
"""A keyword without a unit ("distance: 2") is in metres."""
_EACH_MINUTE = r"(?:times|breaths?|beats?)? ?(?:a|per|each|every|/) ?(?:minute|min)"
BREATHING_PATTERNS: tuple[tuple[float | None, str], ...] = (
    (0.0, r"(?:and |while |with )?(?:<hold|held|holding> <a>breath|<a>breath held)"),
    (
        None,
        rf"(?:and |while |with )?(?:<breathe> |<a>(?:breathing|respiratory|respiration) (?:rate )?)(?:at |of |with )?"
        rf"(?P<value><n>) ?{_EACH_MINUTE}",
    ),
    (None, r"(?:and |with )?<a>(?:breathing|respiratory|respiration) rate (?:of |at )?(?P<value><n>)(?: bpm)?"),
    (15.0, r"(?:and |while )?<breathe>(?: (?:calmly|normally|quietly))?(?= ,| and|$)"),
)
"""Breaths a minute; None takes the group `value`."""
HEART_PATTERNS: tuple[tuple[float | None, str], ...] = (
    (None, rf"(?:and |with )?<a>(?:heart ?rate|pulse|heart ?beat|heart)(?: (?:of|at|beats|beating))*"
           rf" (?P<value><n>)(?: ?(?:bpm|{_EACH_MINUTE}))?"),
)  # fmt: skip
"""Heartbeats a minute."""
BARE_LENGTH = (
    rf"(?:(?<=, )|^){_LENGTH}(?= ,|$)|(?:(?<=man )|(?<=male )|(?<=person )|(?<=adult )|(?<=~ ))(?:of )?"
    rf"{_LENGTH.replace('<value>', '<value2>').replace('<unit>', '<unit2>')}(?= (?:,|and|~)|$)"
)
"""A length without its quantity: a distance, or a height after a person."""
_UNIT = r"(?:m|met(?:re|er)s?|cm|centimet(?:re|er)s?|feet|foot|ft)"
SEVERAL_NUMBERS = (
    rf"(?:between )?<n> (?:to|or|till|until|through) <n> (?:{_UNIT}|degrees?|kg|kilos?|kilograms?|lbs?|pounds?|years?)"
    rf"|between <n> and <n> [a-z]+|<n> {_UNIT}(?: (?:to|or|and|till|until))?(?: at)? <n> {_UNIT}(?! (?:tall|high|in height))"
    r"|(?:distance|range|azimuth|bearing|orientation|height|weight|age)(?: of)? <n> (?:to|or|till|until|through) <n>"
)
"""Two numbers for one value: "at 2-3 m", "between 2 and 3 m", "at 2 m and 3 m"."""
UNREAD_DISTANCE = (
    rf"(?:at|distance|range)(?: of)? (?:minus )?[\w.]*\d[\w.]*(?: [a-z]{{1,2}}\d*)? {_UNIT}(?! (?:tall|high|per))"
)
"""A distance with an invalid number."""
PERSON = (
    r"(?:persons?|people|humans?(?: beings?)?|someone|somebody|individuals?|subjects?|pedestrians?|m[ae]n|wom[ae]n|guys?|lad(?:y|ies)"
    r"|gentlem[ae]n|adults?|child(?:ren)?|kids?|boys?|girls?|teen(?:ager)?s?|seniors?|elders?|males?|females?|he|she)"
)
HEIGHT_PATTERNS: tuple[str, ...] = (
    rf"(?:<a>height (?:of )?){_LENGTH}(?: tall)?",
    rf"{_LENGTH} (?:tall|high|in height)",
    rf"(?<=\ba ){_LENGTH}(?= (?:(?!(?:an?|the|distant|away|distance|range|wide|long|from)\b)[a-z]+ ){{0,2}}{PERSON})",
)
WEIGHT_PATTERN = (
    r"(?:(?:<weigh>|weight)(?: of)? )?"
    + _ABOUT
    + r"(?P<value><n>) (?P<unit>kg|kilos?|kilograms?|lbs?|pounds?)(?: heavy)?"
)
AGE_PATTERN = (
    r"(?:(?:aged|age|age of) )(?P<value><n>)(?: years?(?: old)?)?|(?P<value2><n>) (?:years? (?:old|of age)|yo)"
)
METRES = {"m": 1.0, "c": 0.01, "f": 0.3048}
"""First letter of a unit of length -> metres."""
KILOGRAMS = {"k": 1.0, "l": 0.45359237, "p": 0.45359237}

SPEED_PATTERNS: tuple[tuple[float, str], ...] = (
    (0.5, r"(?:very|extremely|really) (?:slowly|slow)"),
    (1.6, r"(?:very|extremely|really) (?:quickly|quick|fast|rapidly)|as (?:fast|quickly) as possible"),
    (0.7, r"slowly|slow|leisurely|gently|gentle|unhurriedly"),
    (1.3, r"quickly|quick|fast|rapidly|rapid|briskly|brisk|swiftly|swift|hurriedly|energetically|vigorously"),
)
PACE_PATTERNS: tuple[tuple[float, str], ...] = (
    (0.7, r"(?:at|with|in) <a>(?:slow|leisurely|gentle|unhurried|low) (?:speed|pace)"),
    (1.3, r"(?:at|with|in) <a>(?:fast|quick|brisk|rapid|swift|high) (?:speed|pace)"),
    (1.0, r"(?:(?:at|with|in) )?<a>(?:normal|usual|ordinary|medium) (?:speed|pace)"),
)
"""(factor on the usual speed, pattern) of nouns, read before the verb "pace"."""

PLURAL = (
    r"(?:persons|people|humans|individuals|subjects|pedestrians|men|women|guys|ladies|gentlemen|adults|children|kids|boys|girls"
    r"|teen(?:ager)?s|seniors|elders|couple|crowd|group|family)"
)

SCENE_PATTERNS: dict[str, str] = {
    "living_room": r"(?:furnished )?(?:living ?room|lounge|sitting room|parlou?r|family room)",
    "simple_street_canyon_with_cars": r"(?:simple )?street(?: canyon)? with (?:parked )?cars",
    "simple_street_canyon": r"(?:(?:simple|residential|city) )?street(?: canyon)?|road(?: in a town)?",
    "box_knife": r"box knife",
    "box_one_screen": r"box (?:with )?(?:one|a) screen",
    "box_two_screens": r"box (?:with )?two screens",
    "box": r"box",
    "double_reflector": r"double reflector|two reflectors",
    "triple_reflector": r"triple reflector|three reflectors",
    "simple_reflector": r"(?:simple |single )?reflector",
    "simple_wedge": r"(?:simple )?wedge",
    "floor_wall": r"floor (?:and <a>)?wall",
    "etoile": r"(?:etoile|étoile|arc de triomphe)(?: (?:in )?paris)?|paris",
    "florence": r"florence|firenze",
    "munich": r"munich|münchen",
    "san_francisco": r"san francisco",
}
"""Name of a scene -> pattern."""
COMMON_SCENE_WORDS = frozenset(SCENE_PATTERNS) - {"living_room", "etoile", "florence", "munich", "san_francisco"}
"""Scenes named by common words."""
IN_VIEW = rf"in front of {_RADAR}"
SCENE_PREFIX = r"(?:in|inside|within|at|on|through|across|along|down|or)"
HOW = (
    r"(?:small|little|tiny|large|big|huge|wide|long|short|narrow|spacious|medium|average|ordinary|typical|normal|usual|empty|bare"
    r"|furnished|unfurnished|cosy|cozy|modern|new|old|clean|tidy|messy|cluttered|crowded|busy|quiet|dark|bright|sunny|shared|private"
    r"|public|open plan|home|school|university|hospital|suburban|grassy|green|flat|never ending)"
)
"""Adjectives of a place without effect: "in a small office"."""
ROOM = (
    r"(?:[a-z]*rooms?|corridor|field|flat|garage|hall|hallway|kitchen|lab|laboratory|lounge|meadow|office|passage|place"
    r"|playground|road|space|street|study|workshop)"
)
"""Last word of a place's name."""
FREE_SPACE = r"(?:(?:in|inside) <a>)?(?:free space|empty space|vacuum|anechoic (?:chamber|room))"
NO_SCENE = rf"{FREE_SPACE}|nothing|none|no (?:environment|surroundings|scene)"
UNKNOWN_PLACE = (
    r"(?:in|inside|within|at|on|through|across|along|down|around|into|outside) <a>(?:[a-z]+ ){0,3}?"
    r"(?:[a-z]*rooms?|[a-z]*house|[a-z]*yard|kitchen|office|lab|laboratory|hall|hallway|corridor|lobby|home|flat|apartment|building|basement"
    r"|cellar|attic|garage|balcony|terrace|porch|garden|park|lot|forest|woods?|field|meadow|beach|desert"
    r"|mountains?|street|road|highway|avenue|alley|pavement|sidewalk|square|plaza|bridge|tunnel|city|town|village"
    r"|downtown|shop|store|mall|market|supermarket|warehouse|factory|workshop|studio|gym|stadium|theatre|theater"
    r"|cinema|museum|church|school|university|library|hospital|clinic|ward|hotel|restaurant|cafe|bar|airport|station"
    r"|train|bus|car|cabin|aircraft|plane|ship|boat|elevator|lift|staircase|stairs|stage|wardrobe|cave)"
    r"|indoors|outdoors|outside"
)
"""Places without a scene, which are refused."""

BOTH_HANDS = r"(?:both|two) (?:of )?<a>(?:arms|hands|(?:index )?fingers)|hands|arms"
BEHIND = rf"(?:<n> {_UNIT} )?behind {_RADAR}"
"""Behind the radar, out of its view."""
PLACE_LIKE = (
    r"(?:in|inside|within) (?:an?|the|his|her|their|my|your|our|some) "
    r"(?P<place>[a-z~]+(?: (?!(?:with|while|who|which|that|and|or|then|at|in|on|to|from|for|facing|by|near|of|a|an|the)\b)[a-z~]+){0,4})"
)
"""Words in the position of a place."""
NO_PLACES = frozenset({
    "manner", "way", "ways", "fashion", "style", "hurry", "rush", "air", "place", "pose", "position", "posture",
    "stance", "shape", "row", "loop", "circle", "circles", "line", "direction", "rhythm", "mood", "motion",
    "movement", "gesture", "middle", "center", "centre", "front", "foreground", "background", "distance", "view",
    "range", "field", "radar", "sensor", "camera", "morning", "afternoon", "evening", "night", "dark", "light",
    "rain", "sun", "wind", "snow", "cold", "heat", "end", "beginning", "past", "future", "meantime", "moment", "time",
    "second", "minute", "seconds", "minutes", "series", "sequence", "burst", "sweep", "arc", "pattern", "order",
    "speed", "pace", "tempo", "half", "hand", "hands", "arm", "arms", "pocket", "pockets", "head", "mind", "body",
    "lap", "fist", "coat", "jacket", "suit", "dress", "shirt", "hat", "hoodie", "sweater", "skirt", "uniform",
    "costume", "outfit", "clothes", "shoes", "boots", "chair", "wheelchair", "squat", "crouch", "lunge", "state",
    "form", "frame", "case", "zigzag", "spiral", "bit", "while", "flash", "spin", "jump", "step", "steps", "walk",
    "angle", "zone", "area", "scene", "picture", "thirties", "forties", "fifties",
    "sixties", "seventies", "eighties", "twenties", "teens",
})  # fmt: skip
"""Nouns after "in a" that are no surroundings: "in a repetitive manner", "in a red coat"."""
REPEATED = (
    r"(?:in|with) <a>(?:repetitive|repeated|repeating|periodic|cyclic) (?:manner|way|fashion|motion|movement|pattern)"
    r"|repeatedly|repetitively|periodically|again and again|over and over(?: again)?|several times|many times"
    r"|multiple times|a few times|continuously|in a loop"
)
"""Words for repetition, a property of gestures, steps and jumps."""

FILLERS = frozenset({
    "a", "an", "the", "of", "is", "are", "be", "being", "been", "and", "or", "with", "while", "who", "whose",
    "that", "which", "in", "on", "at", "to", "into", "by", "for", "as", "there", "this", "it", "its", "he", "she",
    "they", "his", "her", "their", "him", "them", "one", "then", "just", "doing", "do", "does", "done", "did",
    "performing", "performs", "perform", "making", "makes", "make", "made", "showing", "shows", "show", "having",
    "has", "have", "gesture", "motion", "movement", "pose", "posture", "position", "only", "exercise",
    "exercises", "times", "time", "degrees", "orientation",
})  # fmt: skip
"""Words without meaning of their own."""
