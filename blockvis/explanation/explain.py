"""From observations to ranked causes: the runs, the comparison, the refinement around the best."""

from __future__ import annotations

import warnings
from collections.abc import Mapping, Sequence
from concurrent.futures import Executor
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

import solver
from blockvis.case_files.read import case_file_text, case_of, parsed_toml
from blockvis.cases.build import case_assembly
from blockvis.cases.contents import Case
from blockvis.cases.explain_settings import ExplainSettings
from blockvis.kinds.kind import needs_no_crushing
from blockvis.kinds.kinds import KINDS
from blockvis.results.folder import refuse_files
from blockvis.runs.once_more import takes_steps
from blockvis.runs.plan import refuse_ties
from blockvis.runs.progress import RunsProgress
from blockvis.text import place_text
from solver import mechanics

from .candidates import (
    Candidate,
    Ground,
    Twin,
    candidates_of,
    ground_of,
    opens_cracks,
    per_amount,
    refined,
    scaled_motions,
    twins_of,
    unit_vector,
)
from .forward import Order, Run, Variant, all_followed, ordered, reach_of, workers_for
from .likelihood import EXPLAINED, Comparison, Trial, Trust, tried
from .observations import Observations, read_observations
from .ranking import WORTH_A_WORD, Cause, next_measurement, ranked, unexplained
from .result import Explanation
from .words import in_words
from .write import FILES, write_explanation

#: Range of the coefficient of friction, as fractions of that of the case, where the case gives none.
FRICTIONS = (0.8, 1.25)

#: Rounds of runs: all candidates, others around the best of them, and the likeliest with other friction.
ROUNDS = 3

#: Most causes that are looked at more closely, of those worth a word.
MOST_REFINED = 4

#: Candidates of which runs with other coefficients of friction are made, too, at most.
MOST_VARIED = 6


def explain(
    case: Case | str | Path,
    observed: str | Path | Sequence[Mapping[str, Any]],
    folder: str | Path | None = None,
    *,
    overwrite: bool = False,
    workers: int | None = 1,
    scheduler: str | None = None,
    runs: dict[Any, Run] | None = None,
    progress: bool = False,
) -> Explanation:
    """Find the movements of the supports that may have caused observed cracks, in the order of their probability.

    Parameters
    ----------
    case : Case, or path of a case file
        Of the undamaged structure; it needs no settlement. Its table [explain] says which causes are looked at.
    observed : path, or sequence of mappings
        A table of widths or displaced points, its rows, or a drawing of the damaged state.
    folder : str or Path, optional
        Where explain.html, explain.json and explain.png are written; nothing is by default.
    overwrite : bool
        Whether an explanation in the folder may be replaced.
    workers : int, optional
        Processes of this machine; None for one per core.
    scheduler : str, optional
        Address of a Dask scheduler that exists, ``tcp://host:8786``.
    runs : dict, optional
        ``Explanation.runs`` of an earlier explanation: those that fit are not followed again, new ones are added.
        Runs of another drawing, or of other keys than those of [explain], do not fit.
    progress : bool
        Whether a bar, and lines where stderr is no terminal, count the runs and name their causes.

    Raises
    ------
    ValueError
        For bad input, before anything is followed.

    Notes
    -----
    One run along s gives every amount of a movement. The probability of a cause is by Bayes' rule, with a prior that
    weighs causes alike and amounts evenly up to a largest; see `docs/explain.md`. Nothing is drawn at random: the
    same input gives the same answer.
    """
    if folder is not None:
        refuse_files(Path(folder), FILES, "an explanation", overwrite)
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always", UserWarning)
        if not isinstance(case, Case):
            case = read_explained(case)
        case = replace(case, settlements=(), profiles=())
        _refuse_unknown(case)
        refuse_ties(case)
        drawn = case_assembly(case)
        needs_no_crushing(case)
        # The blocks are checked with a settlement of every support.
        roles = np.where(drawn.free, mechanics.FREE, mechanics.MOVING)
        down = solver.Settlement(direction=unit_vector("down", drawn.dimension))
        mechanics.check_settlement(drawn.with_roles(roles), () if drawn.free.all() else (down,), case.controls)
        ground = ground_of(drawn, case.explain, case.source)
        observations = read_observations(observed, ground.assembly, drawn)
    notes = [*(str(warning.message) for warning in caught), *ground.notes]
    search = _Search(case, ground, observations, {} if runs is None else runs)
    notes += _notes_of_frame(search.comparison)
    for note in notes:
        warnings.warn(note, stacklevel=2)
    first = candidates_of(ground, case.explain, case.source)
    if not search.apart:
        first = [one for one in first if opens_cracks(ground.assembly, one)]
    if not first:
        raise ValueError(
            f"{case.source}: [explain] supports moves all that the structure stands on as one, which opens no crack; "
            'leave a support out, add "rotation" to directions, or observe displaced points'
        )
    about = 3 * len(first)
    with workers_for(about, workers, scheduler) as processes, RunsProgress(ROUNDS, shown=progress) as bar:
        search.carry_out(first, processes, bar)
    causes = search.ranked()
    opened, all_points = observations.widths > 0.0, np.ones(len(observations.points), dtype=bool)
    strange: Sequence[np.ndarray] = (opened, opened, all_points, all_points)
    if causes:
        strange = unexplained(search.comparison, causes, search.trials)
    widths, widths_by_none, points, points_by_none = (tuple(np.flatnonzero(which).tolist()) for which in strange)
    found = Explanation(
        case=case,
        assembly=ground.assembly,
        observations=observations,
        comparison=search.comparison,
        causes=tuple(causes),
        unexplained=widths,
        made_by_none=widths_by_none,
        unexplained_points=points,
        points_made_by_none=points_by_none,
        next_measurement=next_measurement(search.comparison, causes) if causes else None,
        runs=search.used,
        notes=tuple(notes),
    )
    found = replace(found, words=in_words(found))
    if folder is not None:
        write_explanation(found, Path(folder))
    return found


def _notes_of_frame(comparison: Comparison) -> list[str]:
    """Say where displacements tell of supports against each other alone; raises ``ValueError`` where of nothing."""
    common, given = comparison.common, comparison.observations
    if common is None:
        return []
    words = f"{given.source}: every support that was surveyed has moved, "
    apart = np.linalg.norm(given.displacements - common, axis=1)
    if not (given.widths > 0.0).any() and (apart <= EXPLAINED * given.point_uncertainties).all():
        raise ValueError(
            f"{words}all by about {place_text(1e3 * common, 3)} mm, and what all have in common opens no joint; there "
            "is nothing to explain: give displacements from a support that stands still, or cracks"
        )
    return [
        f"{words}so displacements are compared but for what they have in common: how supports have moved against each "
        "other; add the row of one that stands still where there is one"
    ]


def _refuse_unknown(case: Case) -> None:
    """Raise ValueError for what happens between two settlements, paths without steps, and ties from the ground.

    One movement of supports against each other is followed, from the drawing on.
    """
    if case.removals:
        raise ValueError(
            f"{case.removals[0].where} takes away what blockvis explain would follow: it knows the structure as "
            "drawn; leave it out, and such blocks out of the drawing"
        )
    if not takes_steps(case):
        raise ValueError(
            f'{case.source}: [analysis] increments is "{case.controls.increments}", which has no steps between two '
            "increments, and blockvis explain follows these; leave it out"
        )
    for tie in case.ties:
        if tie.phase > 1:
            raise ValueError(
                f"{tie.where} '{tie.name}': phase is {tie.phase}, and blockvis explain follows one movement of the "
                "supports; leave phase out, or a tie that was installed after the cracks"
            )
        if any(end.fixed for end in tie.ends):
            raise ValueError(
                f"{tie.where} '{tie.name}' is held by the ground, against which blockvis explain knows no movement; "
                "hold both ends by blocks or supports"
            )
    for number, load in enumerate(case.loads, start=1):
        if load.phase > 1:
            raise ValueError(
                f"{case.source}: [loads {number}] phase is {load.phase}, and blockvis explain has no settlement "
                "before which the load begins to act; leave phase out if it acts from the start, or the load"
            )


def read_explained(path: str | Path) -> Case:
    """Read the case file of an undamaged structure: it may have no settlement, for that is what is looked for."""
    path = Path(path)
    text = case_file_text(path)
    values = parsed_toml(text, path)
    kind = values.get("analysis", {})
    # The first kind is the one that a case file follows which names none.
    followed = next(iter(KINDS))
    if isinstance(kind, Mapping) and kind.get("kind", followed) != followed:
        raise ValueError(f'{path}: explain follows settlements, but [analysis] kind is "{kind["kind"]}"; leave it out')
    values["settlement"] = values.get("settlement", {"direction": [0.0, -1.0]})
    return replace(case_of(values, path, text), settlements=(), profiles=())


def _likeliest(causes: Sequence[Cause]) -> list[Trial]:
    """Choose the candidates whose friction is worth varying, each by its likeliest trial."""
    trials = [
        (cause.probability * weight, trial)
        for cause in causes
        for trial, weight in zip(cause.trials, cause.weights, strict=True)
    ]
    found: list[Trial] = []
    for probability, trial in sorted(trials, key=lambda one: -one[0]):
        if probability > WORTH_A_WORD and not any(trial.candidate == other.candidate for other in found):
            found.append(trial)
    return found[:MOST_VARIED]


class _Search:
    """The trials so far; runs followed earlier are kept by what they depend on, and new ones are added."""

    def __init__(self, case: Case, ground: Ground, observations: Observations, runs: dict[Any, Run]) -> None:
        self.case, self.ground, self.observations, self.runs = case, ground, observations, runs
        self.used: dict[Any, Run] = {}
        settings, drawn = case.explain, ground.assembly
        size = drawn.block_size
        plain = replace(case, text="", explain=ExplainSettings())
        arrays = drawn.vertices, drawn.masses, drawn.density
        #: What runs depend on besides movement, friction and heavier side, which [explain] chooses.
        self.structure = repr(plain), drawn.names, drawn.materials, *(values.tobytes() for values in arrays)
        place = 0.5 * size if settings.place_uncertainty is None else settings.place_uncertainty
        self.reach = reach_of(observations, settings.limit)
        trust = Trust(settings.model_uncertainty, place, settings.outliers)
        self.comparison = Comparison(ground.assembly, observations, trust, self.reach[0])
        own = case.friction_coefficient
        low, high = settings.friction or (FRICTIONS[0] * own, FRICTIONS[1] * own)
        middle = float(np.clip(own, low, high)) if settings.friction is None else 0.5 * (low + high)
        self.frictions = (low, middle, high)
        self.candidates: list[Candidate] = []
        self.trials: list[Trial] = []

    @property
    def apart(self) -> bool:
        """Whether the observations tell movements apart that differ by a translation of everything."""
        return len(self.observations.points) > 0 and self.comparison.common is None

    def usual(self, candidate: Candidate) -> list[tuple[Candidate, Variant]]:
        """Pair a candidate with the variants in which it is looked at first."""
        # Of a ground that bends many candidates open much the same cracks: they stand in for the paths of each.
        heavier_sides = (0,) if candidate.bends else (-1, 1)
        return [(candidate, Variant(self.frictions[1], heavier_side)) for heavier_side in heavier_sides]

    def others(self, trial: Trial) -> list[tuple[Candidate, Variant]]:
        """Pair the candidate of a trial with other coefficients of friction."""
        heavier_sides = (-1, 1) if trial.candidate.bends else (trial.variant.heavier_side,) * 2
        frictions = (self.frictions[0], self.frictions[2])
        return [(trial.candidate, Variant(*both)) for both in zip(frictions, heavier_sides, strict=True)]

    def carry_out(self, first: Sequence[Candidate], processes: Executor | None, bar: RunsProgress) -> None:
        """Follow candidates, others around the best of them, and the likeliest with other coefficients of friction."""
        self.follow([pair for one in first for pair in self.usual(one)], processes, bar)
        worth = [c for c in self.ranked() if c.probability > WORTH_A_WORD][:MOST_REFINED]
        # What opens the same cracks as a cause may have moved obliquely as well.
        alike = [trial.candidate for cause in worth for trial in self.trials if trial.candidate.cause in cause.also]
        around = refined(self.ground, [cause.best.candidate for cause in worth] + alike, first)
        self.follow([pair for one in around for pair in self.usual(one)], processes, bar)
        self.follow([pair for one in _likeliest(self.ranked()) for pair in self.others(one)], processes, bar)

    def follow(self, pairs: Sequence[tuple[Candidate, Variant]], processes: Executor | None, bar: RunsProgress) -> None:
        """Follow candidates in some variants, and compare them with the observations."""
        for one, _ in pairs:
            if one not in self.candidates:
                self.candidates.append(one)
        twins = twins_of(self.ground.assembly, self.candidates)
        wanted: list[tuple[Candidate, Variant, Twin, Candidate, Order]] = []
        orders: dict[Any, Order] = {}
        causes: dict[Any, str] = {}
        for one, variant in pairs:
            if any(t.candidate == one and t.variant == variant for t in self.trials):
                continue
            twin = twins[self.candidates.index(one)]
            shared = self.candidates[twin.of]
            order = ordered(self.case, self.ground.assembly, scaled_motions(shared), variant, self.reach)
            wanted.append((one, variant, twin, shared, order))
            key = self._key(shared, variant)
            if key not in self.runs:
                orders[key] = order
                causes[key] = f"{shared.cause}, friction {variant.friction:.3g}"
        bar.add([causes[key] for key in orders])
        found = all_followed(list(orders.values()), processes, bar)
        self.runs.update(zip(orders, found, strict=True))
        for one, variant, twin, shared, order in wanted:
            factor, unit = per_amount(self.ground.assembly, one)
            twin = replace(twin, scale=twin.scale * factor, travel=twin.travel / factor)
            key = self._key(shared, variant)
            run = self.used[key] = self.runs[key]
            largest = order.settlement.limit * twin.scale
            self.trials.append(tried(self.comparison, one, variant, run, twin, shared, unit, largest))

    def ranked(self) -> list[Cause]:
        """Order the causes so far."""
        return ranked(self.trials, apart=self.apart)

    def _key(self, candidate: Candidate, variant: Variant) -> Any:
        """Name what a run depends on."""
        motions = tuple(sorted(scaled_motions(candidate).items()))
        return (self.structure, motions, variant, self.reach)
