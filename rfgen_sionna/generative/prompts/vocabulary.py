"""Patterns of :mod:`.text_reader` for directions, surroundings and words without meaning of their own.

The order of a table matters: later patterns skip words that earlier ones have read.
"""

# A table of patterns reads best with one phrase to a line.
# ruff: noqa: E501, ISC004

from __future__ import annotations

RADAR = r"<a>(?:radar|sensor|camera|device|antenna)"
ORIENTATION_PATTERNS: tuple[tuple[float, str], ...] = (
    (180.0, rf"(?:<face>|<look>|turned|oriented|orientation)(?: directly)? (?:away(?: from {RADAR})?|backwards?)"),
    (180.0, rf"(?:with )?<a>back (?:is )?(?:turned )?(?:to|towards?|facing) {RADAR}"),
    (270.0, rf"(?:with )?<a>left side (?:is )?(?:turned )?(?:to|towards?|facing) {RADAR}"),
    (90.0, rf"(?:with )?<a>(?:right )?side (?:is )?(?:turned )?(?:to|towards?|facing) {RADAR}"),
    (180.0, r"(?:(?:seen|viewed) )?from behind|rear view|back view"),
    (0.0, rf"(?:<face>|<look>|turned|oriented|orientation)(?: directly| straight)? (?:(?:at|to|towards?) )?(?:{RADAR}|forwards?|<a>front|ahead)"),
    (0.0, rf"(?:directly |straight )?at {RADAR}|(?:(?:seen|viewed) )?from the front|front view|frontal|(?:face|head) on"),
    (90.0, r"(?:<face>|<look>|turned|oriented|orientation) (?:(?:to|towards?) )?(?:the |<a>own )?left(?:wards?)?|(?:in )?left profile"),
    (270.0, r"(?:<face>|<look>|turned|oriented|orientation) (?:(?:to|towards?) )?(?:the |<a>own )?right(?:wards?)?|(?:in )?right profile"),
    (90.0, rf"(?:<face>|<look>|turned|oriented|orientation) (?:sideways|to the side)|(?<!his )(?<!her )(?<!their )(?<!its )(?<!the )(?<!a )(?<!one )(?<!left )(?<!right )side ?on(?: (?:to|towards?) {RADAR})?|sideways (?:to|towards?) {RADAR}|(?:(?<=, )|^)sideways(?= ,|$)|side view"
           r"|(?:(?:seen|viewed) )?from the side|in profile|profile view"),
)  # fmt: skip
"""(angle [degrees], pattern): 0 faces the radar, positive turns towards the person's own left."""

_STRAIGHT = r"(?:(?:straight|right|directly|radially) )*"
FROM_RADAR = rf"{_STRAIGHT}away(?: from {RADAR})?"
TO_RADAR = rf"{_STRAIGHT}(?:(?:back )?(?:towards?|up to|to) {RADAR}|closer(?: to {RADAR})?|nearer(?: to {RADAR})?)"
"""Ways from and to the radar."""
BOTH_WAYS = (
    rf"(?:(?:<walk>|<go|went>|<come|came>|<move>|<stroll>|<pace>) )?(?:towards? and away from {RADAR}|(?:(?:towards?|up to|to) {RADAR}|away(?: from {RADAR})?) and (?:then )?"
    rf"(?:(?:<walk>|<go|went>|<come|came>|<move>) )?(?:back|away(?: from (?:it|{RADAR}))?)(?: again)?)"
)
"""To the radar and back."""
WALKS = r"(?:<walk>|<run|ran>|<stroll>|<jog>|<stride|strode>|<march>|<sprint>|<limp>|<crawl>|<sneak>|<wander>|<pace>)"
GOES = r"(?:<go|went>|<move>|<come|came>|<step>|<head>|<return>|<travel>|<pass>|<cross>)"
_WALKING = rf"(?:{WALKS}|{GOES})(?: [a-z]+ly)?(?: ~+)*"
_ACROSS = (
    rf"tangentially|(?:past|by)(?: {RADAR})?(?= ,| ~|$)|past {RADAR}|across (?:the )?(?:radar|scene|view|field of view|line of sight)"
    rf"|perpendicular(?:ly)? to (?:{RADAR}|the line of sight)|in front of {RADAR} from side to side"
)
WALKING_WAYS: tuple[tuple[str, str], ...] = (
    ("left", rf"{_WALKING} (?P<part>from <a>left (?:side )?to <a>right(?: side)?)"),
    ("right", rf"{_WALKING} (?P<part>from <a>right (?:side )?to <a>left(?: side)?)"),
    ("to", rf"{_WALKING} (?P<part>back (?:to|towards?) {RADAR})"),
    ("to", rf"{_WALKING} (?P<part>radially)(?! (?:towards?|away|to)\b)"),
    ("across", rf"{_WALKING} (?P<part>{_ACROSS})"),
    *(
        (side, rf"{WALKS}(?: [a-z]+ly)?(?: ~+)* (?P<part>(?:(?:to|towards) )?<a>(?:own )?{side}(?:wards?)?(?: side)?)(?! (?:arm|hand|leg|foot|knee|and|or|to)\b)")
        for side in ("left", "right")
    ),
)  # fmt: skip
"""(way, pattern of a phrase with the verb before it); "left" and "right" are the person's own, "across" the radar's view
is one of the two. From the radar's left to its right is to the left of somebody who faces it."""
WAYS = {"to": 0.0, "left": 90.0, "away": 180.0, "right": 270.0}
"""Way -> orientation of people who go forwards [degrees]."""
THE_ROOM = r"(?:in|inside|across|through|around|round|about) the (?:whole |entire )?room"
"""The surroundings, whichever they are."""

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
IN_VIEW = rf"in front of {RADAR}"
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
FREE_SPACE = r"(?:(?:in|inside) <a>)?(?:free space|empty space|(?<!robot )(?<!robotic )vacuum(?! cleaner| cleaning| robot)|anechoic (?:chamber|room))"
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
FILLERS = frozenset({
    "a", "an", "the", "of", "is", "are", "be", "being", "been", "and", "or", "with", "while", "who", "whose",
    "that", "which", "in", "on", "at", "to", "into", "by", "for", "as", "there", "this", "it", "its", "he", "she",
    "they", "his", "her", "their", "him", "them", "one", "then", "just", "doing", "do", "does", "done", "did",
    "performing", "performs", "perform", "making", "makes", "make", "made", "showing", "shows", "show", "having",
    "has", "have", "gesture", "motion", "movement", "pose", "posture", "position", "only", "exercise",
    "exercises", "times", "time", "degrees", "orientation",
})  # fmt: skip
"""Words without meaning of their own."""
