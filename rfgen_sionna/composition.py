"""Composition of a run: surroundings and people, made once for all radars and checked, and a simulator of each."""

from __future__ import annotations

import logging
from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from rfgen_sionna.generative.actor import DEFAULT_DURATION, Actor
from rfgen_sionna.generative.clip_person import person_with_clip
from rfgen_sionna.generative.decisions import DEFAULT, Decision, argument
from rfgen_sionna.generative.environment_setup import RunEnvironment, set_up_environment
from rfgen_sionna.generative.several_actors import actors_from_prompt, actors_report
from rfgen_sionna.generative.things.thing_catalogue import bounces_of
from rfgen_sionna.options import chosen_duration
from rfgen_sionna.radar import Radar
from rfgen_sionna.recording import ImageView, RunPlan, array_digest, run_info, run_plan
from rfgen_sionna.scene.checks.actors import OutsidePolicy, Policy
from rfgen_sionna.scene.floor import floor_under
from rfgen_sionna.scene.mesh_actor import MeshActor
from rfgen_sionna.scene.scene import RadarScene
from rfgen_sionna.scene.scene_errors import PlacementError
from rfgen_sionna.scene_request import SceneRequest, spot_of
from rfgen_sionna.signal.noise import noise_seed
from rfgen_sionna.signal.receiver.receiver_record import ReceiverSource, chosen_receiver
from rfgen_sionna.simulation import Simulator
from rfgen_sionna.tolerance import DEFAULT_RTOL

_LOG = logging.getLogger(__name__)

Placed = Callable[[RadarScene], Sequence[MeshActor]]
"""Function that makes actors for their places in a scene."""


@dataclass(frozen=True)
class TraceOptions:
    """Options of the simulation (:class:`~rfgen_sionna.simulation.Simulator`)."""

    rtol: float = DEFAULT_RTOL
    max_bounces: int | None = 1
    transmission: bool = False
    outside: OutsidePolicy = "error"
    collisions: Policy = "error"


@dataclass(frozen=True)
class Reception:
    """Options of the samples (:meth:`~rfgen_sionna.simulation.Simulator.adc`)."""

    noise: bool = True
    receiver: ReceiverSource | None = None
    draws: bool = True
    """Whether the receiver draws from the seed."""
    device: str = "auto"


def compose(
    request: SceneRequest,
    radars: Mapping[str, Radar],
    *,
    duration: float | None,
    view: ImageView,
    images: bool = True,
    trace: TraceOptions = TraceOptions(),
    reception: Reception = Reception(),
    placed: Placed | None = None,
    keep: Collection[str] | None = None,
    report: Callable[[str], None] | None = None,
    **more: Any,
) -> dict[str, RunPlan]:
    """Surroundings, people and simulators of a run, checked: its frames can be traced.

    Parameters
    ----------
    request
        What the run shows.
    radars
        Placed radars by their names in the file; people are placed before the first one, which must see them.
    duration
        Length [s]; None is that of the longest motion.
    view
        Images, and the view of imagined surroundings.
    images
        Whether images are stored.
    trace, reception
        Options of the simulation and of the samples.
    placed
        Function that makes further actors, once the scene is known.
    keep
        What is stored, as in :func:`rfgen_sionna.record`.
    report
        Called once with the decisions; None logs them.
    more
        Further properties of the run (:class:`~rfgen_sionna.dataset.RunInfo`).

    Raises
    ------
    PlacementError
        If somebody cannot be at his place: in a wall, hidden or too far.
    PromptError, ValueError
        If a prompt cannot be carried out, or an option is wrong.
    """
    settings = _settings(request, radars, view)
    name, radar = next(iter(radars.items()))
    setting = settings[name]
    others = request.others
    kinds = [each.thing_record.kind for each in others if isinstance(each, Actor) and each.thing_record]
    needed = max(map(bounces_of, [*kinds, "", *(said.target for said in request.said)]))
    corners = trace.max_bounces is not None and trace.max_bounces < needed
    traced: dict[str, Any] = {
        "rtol": trace.rtol,
        "max_bounces": needed if corners else trace.max_bounces,
        "transmission": trace.transmission,
        "outside": trace.outside,
    }
    for key, each in radars.items():
        Simulator(settings[key].scene, each, others, **traced)

    decisions = list(setting.decisions)
    if corners:
        decisions.append(Decision("max_bounces", str(needed), "the corner reflector returns by so many"))
    people = _people(request, setting.scene, radar, duration, decisions)
    added = () if placed is None else tuple(placed(setting.scene))
    others = (*others, *added)
    duration = chosen_duration(duration, people or others)
    simulators = {
        key: Simulator(
            settings[key].scene,
            each,
            (*people, *others),
            **traced,
            collisions=trace.collisions,
            seed=request.seeds.speckle,
            environment=settings[key].environment,
            refiner=settings[key].refiner,
        )
        for key, each in radars.items()
    }
    said = (*people, *(each for each in added if isinstance(each, Actor) and each.prompt is not None))
    _check_visible(simulators[name], setting, said, duration)
    decisions += [Decision("actor", f"{each.name}: {each.material_names}", argument("actors")) for each in others]
    text = actors_report(said, decisions)
    if report is None:
        _LOG.info("%s", text)
    else:
        report(text)
    plans = {}
    for index, (key, simulator) in enumerate(simulators.items()):
        seed = noise_seed(request.seeds.noise, index)
        shown = view if images else None
        plans[key] = _plan(
            request, simulator, settings[key], duration, shown, reception, seed, keep, report=text, **more
        )
        if index:  # before the frames of the first radar
            plans[key].frames(0, None)
    return plans


def _settings(request: SceneRequest, radars: Mapping[str, Radar], view: ImageView) -> dict[str, RunEnvironment]:
    """Surroundings of each radar: one scene for all radars of a carrier frequency, one image for each radar."""
    made: dict[Any, RunEnvironment] = {}
    found = {}
    for name, radar in radars.items():
        key = name if request.source == "diffusion" else radar.center_frequency
        if key not in made:
            made[key] = set_up_environment(
                request.surroundings,
                request.source,
                radar,
                seed=request.seeds.surroundings,
                image_options=request.image_options,
                fov_deg=view.fov_deg,
                resolution=view.resolution,
                projection=view.projection,
            )
        found[name] = made[key]
    return found


def _people(
    request: SceneRequest, scene: RadarScene, radar: Radar, duration: float | None, decisions: list[Decision]
) -> tuple[Actor, ...]:
    """Actors of the prompt on the floor of the scene, which joins the decisions."""
    if request.read is None:
        return ()
    found = floor_under(scene, (*spot_of(request.read, radar), float(radar.position[2])))
    height, why = (0.0, "no surface there, so height 0") if found is None else (found[0], f"'{found[1]}' there")
    decisions.append(Decision("floor", f"{height + 0.0:.2f} m", why))
    if request.clip is not None:
        clip: dict[str, Any] = {"up": request.up, "frame_rate": request.frame_rate, "seed": request.seeds.body}
        return (person_with_clip(request.said[0], request.clip, radar=radar, floor=height, **clip),)
    people = actors_from_prompt(
        request.read,
        seed=request.seeds.motion,
        duration=DEFAULT_DURATION if duration is None else duration,
        radar=radar,
        floor=height,
        motion=request.motion,
    )
    if request.motion != "auto":
        return people
    return tuple(replace(each, decisions=tuple(map(_by_default, each.decisions))) for each in people)


def _by_default(decision: Decision) -> Decision:
    return replace(decision, origin=DEFAULT) if decision.name == "motion" else decision


def _check_visible(simulator: Simulator, setting: RunEnvironment, people: Sequence[Actor], duration: float) -> None:
    """PlacementError if static surfaces hide somebody from the radar all the time."""
    # Surroundings from an image are opaque.
    opaque = setting.environment is not None or not simulator.transmission
    for person in people if opaque else ():
        if not simulator.is_occluded(person, 0.0, duration):
            continue
        if setting.environment is None:
            scene = simulator.scene.name
            what, remedy = f"the surfaces of scene '{scene}' hide", "choose another distance or environment"
        else:
            what, remedy = f"surroundings of the {setting.name} hide", "choose another distance, seed or environment"
        away = float(np.hypot(*(np.asarray(person.position) - np.asarray(simulator.radar.position))[:2]))
        raise PlacementError(
            f"distance is {away:.3g} m: {what} the {person.name} from the radar there; {remedy}, or place the radar "
            "elsewhere"
        )


def _plan(
    request: SceneRequest,
    simulator: Simulator,
    setting: RunEnvironment,
    duration: float,
    view: ImageView | None,
    reception: Reception,
    seed: int,
    keep: Collection[str] | None,
    **more: Any,
) -> RunPlan:
    """Run of one radar, with its properties."""
    seeds, actors = request.seeds, simulator.actors
    receiver = chosen_receiver(reception.receiver, simulator.radar, reception.noise)
    people = [each for each in actors[: len(request.said)] if isinstance(each, Actor)]
    with_body = any(isinstance(each, Actor) and each.body is not None for each in actors)
    info = run_info(
        simulator,
        simulator.frame_times(duration),
        noise=reception.noise,
        seed=seed,
        receiver=receiver,
        prompt=request.prompt,
        negative_prompt=request.negative,
        environment=setting.name,
        seeds={
            "body": seeds.body if with_body else None,
            "motion": seeds.motion if people and request.clip is None else None,
            "surroundings": seeds.surroundings if request.source in ("furnished", "diffusion") else None,
            "speckle": seeds.speckle,
            "noise": seed if reception.draws else None,
        },
        **more,
    )
    if setting.environment is not None:
        shown = array_digest([setting.environment.energy, setting.environment.time_of_arrival])
        refine = request.image_options.refine
        info = replace(info, settings={**info.settings, "image": shown, "refine": refine})
    options: dict[str, Any] = {
        "noise": reception.noise, "seed": seed, "receiver": receiver, "device": reception.device,
    }  # fmt: skip
    return run_plan(simulator, info, view, duration, keep=keep, **options)
