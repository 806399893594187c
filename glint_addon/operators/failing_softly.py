"""The one place where the extension's errors are caught: an operator reports the sentence and cancels."""

from ..errors import GlintError


class FailsSoftly:
    """Mixin for operators: `execute` calls `run`, and a GlintError of `run` becomes a report."""

    def execute(self, context):
        """Run the operator; {'CANCELLED'} with an error report if it raises a GlintError."""
        try:
            return self.run(context)
        except GlintError as error:
            self.report({"ERROR"}, str(error))
            return {"CANCELLED"}
