"""The one place where the extension's errors are caught: an operator reports the sentence and cancels."""

from ..errors import CancelledError, GlintError


class FailsSoftly:
    """Mixin for operators: `execute` calls `run`, and a GlintError of it becomes a report."""

    def execute(self, context):
        """Run the operator; {'CANCELLED'} with an error report if it raises a GlintError."""
        return self.softly(self.run, context)

    def softly(self, work, context):
        """What `work(context)` returns; {'CANCELLED'} with an error report if it raises a GlintError."""
        try:
            return work(context)
        except GlintError as error:
            # Whoever cancels knows: no error pops up.
            self.report({"INFO" if isinstance(error, CancelledError) else "ERROR"}, str(error))
            return {"CANCELLED"}
