"""Heat map of the gap over joints and regimes of the motion."""

import numpy as np
import plotly.graph_objects as go

from testbench.report.style import TEMPLATE

from ..decision.findings import Diagnosis
from ..residual.shares import RegimeShare
from .words import LEAST_SHOWN

HEAT = ["#ffffff", "#f08a4b", "#a61e22"]
# Per cent of the whole gap beyond what is expected of a regime that have its full colour.
BEYOND = 50.0
ALL = ("joint", "all")
# Wider than the one column that it heads.
BROKEN = {"acceleration": "accele-<br>ration"}


def where(diagnosis: Diagnosis) -> go.Figure:
    """Shares of the gap in numbers; coloured is what a regime has beyond the share expected of it.

    Aspects divide a joint's own share each anew, so that their parts overlap.
    """
    names, units = diagnosis.robot.joint_names, diagnosis.robot.units()
    columns = list(dict.fromkeys((r.aspect, r.part) for each in diagnosis.where for r in each.regimes))
    of_joint = _Cells([ALL], len(names))
    of_regime = _Cells(columns, len(names))
    for each in diagnosis.where:
        joint, unit = each.joint, units[each.joint]
        share = 100 * each.share
        hint = (
            f"{names[joint]}<br>{share:.1f} % of the gap<br>"
            f"RMS {each.gap_rms:.3g} {unit}, noise {each.noise_rms:.3g} {unit}"
        )
        of_joint.fill(joint, ALL, share, share, hint)
        for part in each.regimes:
            own = share * part.share
            of_regime.fill(
                joint, (part.aspect, part.part), own, share * part.excess, _hint(names[joint], part, unit)
            )
            if part.cycles is not None and own >= 100 * LEAST_SHOWN:
                per = "m" if diagnosis.robot.chain.is_slide[joint] else "turn"
                of_regime.text[joint, columns.index((part.aspect, part.part))] += (
                    f"<br>{part.cycles:.3g}/{per}"
                )
    figure = go.Figure(layout={"template": TEMPLATE, "height": 170 + 36 * len(names)})
    figure.add_trace(of_joint.drawn(names, 100.0))
    if columns:
        figure.add_trace(of_regime.drawn(names, BEYOND))
    figure.update_xaxes(
        side="top", showgrid=False, showline=False, tickangle=0, tickfont_size=11, dividercolor="#c6ccd3"
    )
    figure.update_yaxes(autorange="reversed", automargin=True, showgrid=False, showline=False)
    return figure.update_layout(margin={"l": 90, "r": 16, "t": 96, "b": 12})


class _Cells:
    """Numbers, colours and hover texts, a row a joint and a column an aspect's part."""

    def __init__(self, columns: list[tuple[str, str]], joints: int):
        self.columns = columns
        self.colour = np.full((joints, len(columns)), np.nan)
        self.text = np.full(self.colour.shape, "", dtype=object)
        self.hover = self.text.copy()

    def fill(self, joint: int, column: tuple[str, str], share: float, colour: float, hover: str) -> None:
        """Set one cell; share and colour in per cent of the whole gap."""
        cell = joint, self.columns.index(column)
        self.colour[cell], self.hover[cell] = max(colour, 0.0), hover
        self.text[cell] = f"{share:.0f} %" if share >= 100 * LEAST_SHOWN else ""

    def drawn(self, names: tuple[str, ...], full: float) -> go.Heatmap:
        """The cells, at their deepest colour from ``full`` per cent on."""
        aspects = [BROKEN.get(aspect, aspect) for aspect, _ in self.columns]
        parts = ["<br>".join(part.rsplit(" ", 1)) for _, part in self.columns]
        return go.Heatmap(
            z=self.colour,
            x=[aspects, parts],
            y=list(names),
            text=self.text,
            texttemplate="%{text}",
            textfont_size=11,
            hovertext=self.hover,
            hovertemplate="%{hovertext}<extra></extra>",
            colorscale=HEAT,
            zmin=0,
            zmax=full,
            xgap=2,
            ygap=2,
            showscale=False,
        )


def _hint(name: str, part: RegimeShare, unit: str) -> str:
    return (
        f"{name}, {part.regime}<br>{100 * part.share:.0f} % of the joint's gap "
        f"({100 * part.low:.0f} to {100 * part.high:.0f} %)<br>"
        f"{100 * part.expected:.0f} % expected of a gap that has nothing to do with it<br>"
        f"RMS {part.rms:.3g} {unit}"
    )
