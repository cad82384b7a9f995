"""What a diagnosis shows to people: page, summary, Rerun session."""

import io
import json
import re
from dataclasses import replace
from pathlib import Path

from rerun.chunk import RrdReader
from rich.console import Console

from diagnosis.decision.findings import Diagnosis
from diagnosis.report.document import diagnosis_document
from diagnosis.report.page import render
from diagnosis.report.session import write_session
from diagnosis.report.summary import summary
from testbench.log import Recording
from testbench.recording import POSE_RATE
from testbench.robot import Robot
from testbench.torque_lag import TorqueLag

from ...diagnosed import diagnosed, in_closed_loop
from ...html_page import Page
from .conftest import WRITTEN


def test_page_shows_every_section_without_network(answer: Diagnosis, runs: dict[str, Recording]) -> None:
    text = render(
        answer, "today", replace(WRITTEN, lacks=("nothing carries it",)), in_closed_loop(answer, runs)
    )
    page = Page(text)
    assert page.sources == []
    assert {"where", "evidence", "waterfall", "gap", "signature-0", "residual", "forward"} <= page.ids
    for words in ("Stribeck friction", "presliding hysteresis", "nothing carries it", "explains less"):
        assert words in text
    figures = re.findall(r'<script type="application/json" id="[\w-]+-data">(.*?)</script>', text, re.DOTALL)
    assert all(json.loads(figure)["data"] for figure in figures)


def test_page_of_a_clean_robot_names_nothing(robot: Robot, runs: dict[str, Recording]) -> None:
    plain = diagnosed(robot, {"run_1": runs["run_1"]}, [])
    page = Page(render(replace(plain, ranked=(), where=()), "today"))
    assert not {"where", "evidence", "signature-0", "forward"} & page.ids


def test_summary_is_at_most_ten_lines(answer: Diagnosis) -> None:
    console = Console(width=400, record=True, file=io.StringIO())
    console.print(summary(answer))
    lines = console.export_text().splitlines()
    assert len(lines) <= 10
    assert any("Stribeck friction, lift: 93 %" in line for line in lines)


def test_summary_says_last_what_error_the_written_file_has(answer: Diagnosis) -> None:
    last = summary(answer, None, WRITTEN).plain.splitlines()[-1]
    assert "12 given → 6 by corrected.xml along these runs, 3 by the diagnosis's laws" in last


def test_where_there_is_no_gap_nothing_is_closed_and_no_place_is_found(answer: Diagnosis) -> None:
    none = replace(answer, verdict="none", effects=())
    assert answer.gap.closed is not None
    assert diagnosis_document(none)["gap"]["closed"] is None
    assert "where" in summary(answer).plain
    assert "where" not in summary(none).plain


def test_what_would_be_nothing_per_cent_is_neither_drawn_nor_reported(answer: Diagnosis) -> None:
    nothing = replace(
        answer,
        where=tuple(replace(each, share=0.004) for each in answer.where),
        ranked=tuple(replace(each, probability=0.004) for each in answer.ranked),
    )
    shown, hidden = (Page(render(each, "today")).ids for each in (answer, nothing))
    assert {"where", "evidence"} <= shown
    assert not {"where", "evidence"} & hidden
    assert "where" not in summary(nothing).plain


def test_session_holds_both_residuals_and_the_moving_arm(answer: Diagnosis, tmp_path: Path) -> None:
    write_session(answer, tmp_path / "session.rrd")
    rows: dict[str, int] = {}
    for chunk in RrdReader(tmp_path / "session.rrd").stream():
        rows[chunk.entity_path] = max(rows.get(chunk.entity_path, 0), chunk.num_rows)
    for run in answer.prepared.runs:
        for joint in answer.robot.joint_names:
            for series in ("before", "after"):
                assert rows[f"/{run.name}/joints/{joint}/residual/{series}"] == len(run.time)
        assert rows[f"/{run.name}/joints/lift/effects/1_stribeck_friction"] == len(run.time)
        assert f"/{run.name}/joints/turn/effects/1_stribeck_friction" not in rows
        assert rows[f"/{run.name}/arm/measured/ram"] == len(run.logged.time[:: round(1000 / POSE_RATE)])
    assert {"/summary", "/evidence"} <= set(rows)


def test_page_says_first_what_the_logs_have_late(answer: Diagnosis) -> None:
    late = replace(answer, prepared=replace(answer.prepared, lag=TorqueLag(0.012)))
    text = render(late, "now")
    assert text.index("all torque 12 ms late") < text.index("Which effect")
    assert "ms late" not in render(answer, "now")
