"""Denoise in the way that keeps most of the glints."""

import bpy

# Guided by albedo and normal, Blender's default, the denoiser takes light from the brightest glints; by albedo alone
# the error is less, and least without a denoiser where glints make up the picture: decision 58.
SOFTENING, KEEPING = "RGB_ALBEDO_NORMAL", "RGB_ALBEDO"
ADVICE = "Denoising by normals softens glints. If they make up the picture, take more samples instead."


class GLINT_OT_keep_glints(bpy.types.Operator):
    """Denoise by albedo alone, without the normals, with Accurate prefilter and High quality"""

    bl_idname = "glint.keep_glints"
    bl_label = "Keep Glints"
    bl_options = {"REGISTER", "UNDO"}

    @classmethod
    def poll(cls, context):
        if not context.scene.is_editable:
            cls.poll_message_set("This scene is linked from another file: change its denoising there")
        elif not softens_glints(context.scene):
            cls.poll_message_set("The render is not denoised by albedo and normal: nothing to change")
        else:
            return True
        return False

    def execute(self, context):
        """Set Render > Sampling > Denoise."""
        cycles = context.scene.cycles
        cycles.denoising_input_passes = KEEPING
        cycles.denoising_prefilter = "ACCURATE"
        cycles.denoising_quality = "HIGH"
        self.report({"INFO"}, "Denoising by albedo alone, with Accurate prefilter and High quality")
        return {"FINISHED"}


def softens_glints(scene) -> bool:
    """Whether renders of `scene` are denoised in the way that costs glints their light."""
    # Which denoiser is not asked: Cycles would look for GPUs to answer, and panels ask at every redraw.
    cycles = getattr(scene, "cycles", None)  # Cycles may be switched off in Preferences
    return (
        cycles is not None
        and scene.render.engine == "CYCLES"
        and cycles.use_denoising
        and cycles.denoising_input_passes == SOFTENING
        and any(layer.use and layer.cycles.use_denoising for layer in scene.view_layers)
    )
