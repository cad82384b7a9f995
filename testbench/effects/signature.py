"""How an effect shows along logged signals: columns that are added to the regressor.

With Y theta the rigid-body and friction model, a log of a robot that has the effect satisfies

    tau = Y theta + columns @ c

for one member of the effect's family. Columns are linear in c; whatever enters nonlinearly (a Stribeck
velocity, a gap) is a member's ``shape``, on a small grid. Columns are at the full rate and unfiltered:
whoever fits them passes them through the same low-pass and decimation as torque and regressor.

An effect's file has ``signature(runs, joint, into) -> Family``: ``runs`` are the logs that are fitted
together, ``joint`` the joint or None for an effect of the whole robot, ``into`` the second joint of a
pair or None.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from .base import EffectDescription, Scope
from .columns import over_all_joints
from .logged import Logged as Logged

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Quantity:
    """One parameter of an effect with its standard deviation; tuples where it has several components."""

    value: float | tuple[float, ...]
    std: float | tuple[float, ...]
    unit: str


@dataclass(frozen=True)
class Member:
    """One member of a family.

    shape: the nonlinear parameters it stands for. rows: the r joints whose torque it touches.
    columns: a run, (N, r, k): added torque for a unit of each coefficient. lower, upper: (k,) bounds of
    the coefficients, which carry sign and size. law: of the catalogue; None is the effect's first. widths:
    (k,) deviations of the coefficients on arms in general, where runs may leave them open; None for any size.
    """

    shape: dict[str, float]
    rows: tuple[int, ...]
    columns: Sequence[Array]
    lower: Array
    upper: Array
    law: str | None = None
    widths: Array | None = None

    @property
    def count(self) -> int:
        """Number of coefficients, k."""
        return len(self.lower)

    @cached_property
    def largest(self) -> float:
        """Largest absolute value of its columns."""
        return max(float(np.abs(run).max(initial=0.0)) for run in self.columns)

    @cached_property
    def rms(self) -> Array:
        """RMS (k,) of its columns, at the first of its rows."""
        parts = [(np.sum(run[:, 0] ** 2, axis=0), len(run)) for run in self.columns]
        squares, samples = (np.sum(each, axis=0) for each in zip(*parts, strict=True))
        return np.asarray(np.sqrt(squares / samples))

    def spread(self, run: int, joints: int) -> Array:
        """The columns of one run over all joints, (N, n, k); zero where the effect does not reach."""
        return over_all_joints(self.columns[run], self.rows, joints)


@dataclass(frozen=True)
class Family:
    """All ways an effect can show at one place, for the same runs.

    effect: its name. joint, into: where; None as in the contract. members: the grid, at least one; empty
    when these runs cannot hold the effect at all (no window of contact, no command to saturate).
    parameters: (member, c (k,), covariance (k + s, k + s)) to the contract's parameters; the covariance
    is of the coefficients and then of the s refined shapes, in the order of ``refine``.
    refine: continuous shapes and the range they may be searched in; a member without them has none.
    member: the member at any such shape. made_with: names in a shape that ``member`` takes beside a member's.
    swallowed: re-identification takes most of it up, so look for it in the parameters' shift. picked_from:
    how many shapes its members were picked from by what the runs look like; 0 where they are all there is.
    richer: members by laws that have a member's own in them, and more.
    """

    effect: str
    joint: int | None
    members: tuple[Member, ...]
    parameters: Callable[[Member, Array, Array], dict[str, Quantity]]
    refine: dict[str, tuple[float, float]] = field(default_factory=dict)
    member: Callable[[Mapping[str, float]], Member] | None = None
    made_with: tuple[str, ...] = ()
    into: int | None = None
    swallowed: bool = False
    picked_from: int = 0
    richer: Callable[[Member], tuple[Member, ...]] | None = None

    @property
    def differs_in_kind(self) -> bool:
        """Whether its members have shapes that are not refined, of which another may hold as well."""
        return any(name not in self.refine for member in self.members for name in member.shape)

    @property
    def of_all_laws(self) -> tuple[Member, ...]:
        """Its members, and those by the laws that the first one's is a part of."""
        return (*self.members, *(self.richer(self.members[0]) if self.richer and self.members else ()))

    def at(self, shape: Mapping[str, float]) -> Member | None:
        """The member of that shape, or None where these runs have none."""
        if self.member is not None and shape:
            return self.member(shape)
        return next((member for member in self.members if member.shape == shape), None)


def grid_family(
    effect: str,
    joint: int | None,
    member: Callable[[Mapping[str, float]], Member],
    grid: Mapping[str, Sequence[float]],
    parameters: Callable[[Member, Array, Array], dict[str, Quantity]],
    into: int | None = None,
    swallowed: bool = False,
    wider: Mapping[str, tuple[float, float]] | None = None,
) -> Family:
    """A family on the product of a grid of shapes, each refined between its smallest and largest value.

    wider: ranges that some are refined in instead.
    """
    shapes: list[dict[str, float]] = [{}]
    for name, values in grid.items():
        shapes = [{**shape, name: float(value)} for shape in shapes for value in values]
    return Family(
        effect=effect,
        joint=joint,
        members=tuple(member(shape) for shape in shapes),
        parameters=parameters,
        refine={name: (float(min(values)), float(max(values))) for name, values in grid.items()}
        | dict(wider or {}),
        member=member,
        into=into,
        swallowed=swallowed,
    )


def quantities(
    description: EffectDescription, values: Mapping[str, float], std: Mapping[str, float]
) -> dict[str, Quantity]:
    """The contract's parameters from numbers by name, with the units of the description."""
    return {
        parameter.name: Quantity(float(values[parameter.name]), float(std[parameter.name]), parameter.unit)
        for parameter in description.parameters
    }


def coefficients_as_named(
    description: EffectDescription, names: Sequence[str]
) -> Callable[[Member, Array, Array], dict[str, Quantity]]:
    """The ``parameters`` of a family whose coefficients are ``names`` and whose other parameters are shapes.

    Shapes follow the coefficients in the covariance, in the order of the member's ``shape``.
    """

    def parameters(member: Member, c: Array, covariance: Array) -> dict[str, Quantity]:
        order = [*names, *member.shape]
        values = dict(zip(order, [*c, *member.shape.values()], strict=True))
        deviations = np.sqrt(np.maximum(np.diag(covariance), 0.0))
        std = dict.fromkeys(order, 0.0) | {name: float(d) for name, d in zip(order, deviations, strict=False)}
        return quantities(description, values, std)

    return parameters


def amplitude_and_phase(cosine: float, sine: float, covariance: Array) -> tuple[float, float, float, float]:
    """Amplitude, its std, phase (rad) and its std of cosine·cos x + sine·sin x = amplitude·sin(x + phase).

    covariance: (2, 2) of (cosine, sine); standard deviations to first order.
    """
    amplitude = float(np.hypot(cosine, sine))
    phase = float(np.arctan2(cosine, sine))
    along = np.array([np.sin(phase), np.cos(phase)])
    across = np.array([np.cos(phase), -np.sin(phase)]) / max(amplitude, np.finfo(float).tiny)
    return (
        amplitude,
        float(np.sqrt(max(float(along @ covariance @ along), 0.0))),
        phase,
        float(np.sqrt(max(float(across @ covariance @ across), 0.0))),
    )


def wave_parameters(c: Array, covariance: Array, unit: str) -> dict[str, Quantity]:
    """Amplitude and phase of a wave, and of a second one where there is one.

    c: (2,) or (4,) cosine and sine of each, as of ``amplitude_and_phase``.
    """
    found = {}
    for prefix, at in zip(("", "second_"), range(0, len(c), 2), strict=False):
        own = slice(at, at + 2)
        cosine, sine = c[own].tolist()
        amplitude, amplitude_std, phase, phase_std = amplitude_and_phase(cosine, sine, covariance[own, own])
        found[f"{prefix}amplitude"] = Quantity(amplitude, amplitude_std, unit)
        found[f"{prefix}phase"] = Quantity(phase, phase_std, "rad")
    return found


def places(
    description: EffectDescription, is_slide: NDArray[np.bool_]
) -> tuple[tuple[int | None, int | None], ...]:
    """Where an effect may be on an arm with these joints (n,): (joint, into) as ``signature`` takes them."""
    joints = len(is_slide)
    if description.scope is Scope.ROBOT:
        return ((None, None),)
    if description.scope is Scope.JOINT:
        return tuple((j, None) for j in range(joints) if not (description.hinges_only and is_slide[j]))
    return tuple((first, second) for first in range(joints) for second in range(first + 1, joints))
