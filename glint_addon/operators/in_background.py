"""Operators whose work goes on in a thread while Blender stays awake: it shows progress, and Esc cancels."""

import bpy

from ..prepare.jobs import Running

INTERVAL = 0.1  # seconds between two looks at the work: a short bake must not wait for long
PROGRESS_STEPS = 1000  # Blender's progress cursor counts in whole numbers


class RunsInBackground:
    """Mixin for operators that fail softly: `steps(context)` gives a generator of jobs, `finish(context, result)` ends.

    Started by a button it runs modally, by a script or without a window at once.
    """

    def run(self, context):
        """All at once."""
        from ..prepare.jobs import finished

        manager = context.window_manager
        manager.progress_begin(0, PROGRESS_STEPS)
        try:
            result = finished(
                self.steps(context), lambda fraction, _text: manager.progress_update(round(fraction * PROGRESS_STEPS))
            )
        finally:
            manager.progress_end()
        return self.finish(context, result)

    def invoke(self, context, event):
        """Begin, and look after it at every tick of a timer."""
        if bpy.app.background or context.window is None:
            return self.execute(context)
        manager = context.window_manager
        self.running = Running(self.steps(context))
        self.timer = manager.event_timer_add(INTERVAL, window=context.window)
        manager.progress_begin(0, PROGRESS_STEPS)
        manager.modal_handler_add(self)
        return {"RUNNING_MODAL"}

    def modal(self, context, event):
        """Go on, stop at Esc; other events wait, because the file must not change meanwhile."""
        if event.type == "ESC" and event.value == "PRESS":
            self.running.cancel()
        outcome = self.softly(self.tick, context) if event.type == "TIMER" else {"RUNNING_MODAL"}
        if outcome != {"RUNNING_MODAL"}:
            self.cancel(context)
        return outcome

    def tick(self, context):
        """Show how far the work is, or finish."""
        if self.running.step():
            return self.finish(context, self.running.result)
        context.window_manager.progress_update(round(self.running.fraction * PROGRESS_STEPS))
        context.workspace.status_text_set(f"{self.running.text} ({self.running.fraction:.0%}), Esc to cancel")
        return {"RUNNING_MODAL"}

    def cancel(self, context):
        """Leave: at the end, on an error, or because Blender closes the file or the window."""
        self.running.close()
        context.window_manager.event_timer_remove(self.timer)
        context.window_manager.progress_end()
        context.workspace.status_text_set(None)
