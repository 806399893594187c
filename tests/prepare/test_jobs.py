"""Jobs in a thread, and the operator that looks after them: progress, Esc, errors, and what is left behind."""

import threading
import time
from types import SimpleNamespace

import bpy
import pytest

from glint_addon import create_glint_material
from glint_addon.errors import CancelledError, MapError, SceneError
from glint_addon.operators import in_background
from glint_addon.operators.failing_softly import FailsSoftly
from glint_addon.operators.in_background import RunsInBackground
from glint_addon.paths import TABLE_FOLDER_NAME
from glint_addon.prepare.jobs import Job, Running, finished
from glint_addon.prepare.scene import preparation
from tests.helpers import cycles
from tests.helpers.extension import write_flake_map
from tests.prepare.test_prepare import state

PATIENCE = 20.0  # seconds until a job that hangs fails its test


def steps(log, works):
    """Does `works` one after the other; returns what they return. Notes in `log` that it was closed early."""
    results = []
    try:
        for index, work in enumerate(works):
            value = yield Job(f"Part {index}", index / len(works), (index + 1) / len(works), work)
            results.append(value)
    except BaseException as error:
        log.append(type(error).__name__)
        raise
    return results


def stepped(running):
    """Step until all is finished."""
    end = time.monotonic() + PATIENCE
    while not running.step():
        assert time.monotonic() < end
        time.sleep(0.001)
    return running.result


def told(progress):
    for part in (0.0, 0.5, 1.0):
        progress(part)
    return threading.current_thread().name


def test_at_once_jobs_follow_each_other_and_report_their_share():
    seen = []
    result = finished(steps([], [told, told]), lambda fraction, text: seen.append((fraction, text)))
    assert result == [threading.current_thread().name] * 2
    assert seen == [(0.0, "Part 0"), (0.0, "Part 0"), (0.25, "Part 0"), (0.5, "Part 0"),
                    (0.5, "Part 1"), (0.5, "Part 1"), (0.75, "Part 1"), (1.0, "Part 1")]


def test_at_once_what_progress_raises_closes_the_steps():
    def progress(fraction, text):
        if fraction > 0.3:
            raise CancelledError("stopped")

    log = []
    with pytest.raises(CancelledError):
        finished(steps(log, [told, told]), progress)
    assert log == ["GeneratorExit"]


def test_running_jobs_have_a_thread_of_their_own():
    running = Running(steps([], [told, told]))
    assert all(name.startswith("glint") for name in stepped(running))
    assert (running.fraction, running.text) == (1.0, "Part 1")


def test_steps_without_jobs_are_finished_at_once():
    running = Running(steps([], []))
    assert running.step() and running.result == []


def endless(progress):
    while True:
        progress(0.1)
        time.sleep(0.001)


def test_a_cancelled_job_ends_and_the_steps_are_closed():
    log = []
    running = Running(steps(log, [endless]))
    assert not running.step()
    running.cancel()
    with pytest.raises(CancelledError) as error:
        stepped(running)
    assert log == ["GeneratorExit"] and str(error.value).endswith(".")
    assert not [thread for thread in threading.enumerate() if thread.name.startswith("glint")]


def test_closed_while_a_job_runs_it_ends_first():
    log = []
    running = Running(steps(log, [endless]))
    running.step()
    running.close()
    assert log == ["GeneratorExit"]
    assert not [thread for thread in threading.enumerate() if thread.name.startswith("glint")]


def broken(progress):
    raise MapError("broken.")


def gone(progress):
    raise ReferenceError("StructRNA of type Image has been removed")


@pytest.mark.parametrize(("work", "kind"), [(broken, MapError), (gone, SceneError)])
def test_what_a_job_raises_closes_the_steps(work, kind):
    log = []
    with pytest.raises(kind):
        stepped(Running(steps(log, [told, work])))
    assert log == ["GeneratorExit"]


# --- the operator ---


class Operator(FailsSoftly, RunsInBackground):
    """As Blender's, without Blender's class."""

    def __init__(self, works):
        self.works, self.log, self.reports = works, [], []

    def steps(self, context):
        return steps(self.log, self.works)

    def finish(self, context, result):
        self.result = result
        return {"FINISHED"}

    def report(self, kind, text):
        self.reports.append((*kind, text))


@pytest.fixture
def context(monkeypatch):
    """A context with a window; what is called on its window manager and workspace is noted in `calls`."""
    calls = []

    def noting(name):
        return lambda *arguments, **_: calls.append((name, *arguments)) or name

    names = ("event_timer_add", "event_timer_remove", "modal_handler_add", "progress_begin", "progress_update",
             "progress_end")
    monkeypatch.setattr(in_background, "bpy", SimpleNamespace(app=SimpleNamespace(background=False)))
    return SimpleNamespace(
        calls=calls, window=object(), window_manager=SimpleNamespace(**{name: noting(name) for name in names}),
        workspace=SimpleNamespace(status_text_set=noting("status")))


def ticked(operator, context, *events):
    """What the operator says at its end; `events` come after the first tick."""
    assert operator.invoke(context, None) == {"RUNNING_MODAL"}
    end = time.monotonic() + PATIENCE
    events = [("TIMER", "NOTHING"), *events]
    while time.monotonic() < end:
        kind, value = events.pop(0) if events else ("TIMER", "NOTHING")
        outcome = operator.modal(context, SimpleNamespace(type=kind, value=value))
        if outcome != {"RUNNING_MODAL"}:
            return outcome
        time.sleep(0.001)
    raise AssertionError("the operator does not end")


def has_left(context) -> bool:
    """Whether timer, progress cursor and status text are gone."""
    ends = [("event_timer_remove", "event_timer_add"), ("progress_end",), ("status", None)]
    return context.calls[-3:] == ends


def test_the_operator_finishes_with_the_steps_result(context):
    operator = Operator([told, told])
    assert ticked(operator, context) == {"FINISHED"} and len(operator.result) == 2
    assert has_left(context) and not operator.reports and not operator.log
    assert any(call[0] == "status" and "Esc to cancel" in str(call[1]) for call in context.calls)


def test_esc_cancels_the_operator_without_an_error(context):
    operator = Operator([endless])
    assert ticked(operator, context, ("MOUSEMOVE", "NOTHING"), ("ESC", "PRESS")) == {"CANCELLED"}
    ((kind, text),) = operator.reports
    assert kind == "INFO" and "nothing has changed" in text
    assert has_left(context) and operator.log == ["GeneratorExit"]


def test_an_error_ends_the_operator_with_a_report(context):
    operator = Operator([broken])
    assert ticked(operator, context) == {"CANCELLED"} and operator.reports == [("ERROR", "broken.")]
    assert has_left(context)


def test_without_a_window_the_operator_works_at_once(context):
    context.window = None
    operator = Operator([told])
    assert operator.invoke(context, None) == {"FINISHED"} and operator.result == [threading.current_thread().name]


# --- preparing in a thread ---


@pytest.fixture
def prepared_by(scene, tmp_path):
    """The scene's preparation, not yet begun; its map needs an index and counts."""
    bpy.ops.wm.save_as_mainfile(filepath=str(tmp_path / "scene.blend"))
    cycles.add_sun(scene, (0, 0, 1), angle=0.01)
    flakes = write_flake_map(tmp_path / "flakes.png", 128)
    cycles.add_plane(scene, material=create_glint_material("Sparkle", flakes, interpolation="CLOSEST"))
    return preparation(scene)


def test_a_scene_prepared_in_a_thread_is_as_prepared_at_once(scene, prepared_by):
    report = stepped(Running(prepared_by))
    after = state(scene)
    assert len(report.baked) == 3 and report.hints == ["Sun"]
    assert finished(preparation(scene), lambda fraction, text: None).reused == report.baked
    assert state(scene) == after


def test_a_preparation_cancelled_in_its_thread_leaves_nothing(scene, prepared_by, tmp_path):
    before = state(scene)
    running = Running(prepared_by)
    while not running.text.startswith("Counting"):
        assert not running.step()
    running.cancel()
    with pytest.raises(CancelledError):
        stepped(running)
    assert state(scene) == before and not (tmp_path / TABLE_FOLDER_NAME).exists()
