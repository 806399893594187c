"""Where the panels are, and when those of the report are shown."""


class GlintPanel:
    """Where the panels are: the Material tab of the Properties editor."""

    bl_space_type = "PROPERTIES"
    bl_region_type = "WINDOW"
    bl_context = "material"


class PreparedPanel(GlintPanel):
    """A part of the report; shown once the scene has been prepared."""

    bl_parent_id = "GLINT_PT_material"
    bl_options = {"DEFAULT_CLOSED"}

    @classmethod
    def poll(cls, context):
        return context.scene.glint.prepared
