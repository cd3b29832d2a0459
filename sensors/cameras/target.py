"""Render target of a pass: colour, instance number and depth, one sample per pixel. Imports OpenGL."""

from __future__ import annotations

from collections.abc import Collection

import numpy as np
from OpenGL import GL
from OpenGL.GL.ARB.clip_control import glClipControl

from sensors.cameras.errors import CameraError
from sensors.cameras.images import Content


class RenderTarget:
    """A frame buffer object of 8-bit colour, 16-bit instance number and 32-bit float depth.

    Args:
        width, height: size [px].
    """

    def __init__(self, width: int, height: int) -> None:
        if not glClipControl:
            raise CameraError("this OpenGL has no ARB_clip_control (2014): use backend 'osmesa', or a newer driver")
        self.width, self.height = width, height
        self._frame = GL.glGenFramebuffers(1)
        GL.glBindFramebuffer(GL.GL_FRAMEBUFFER, self._frame)
        for attachment, form in (
            (GL.GL_COLOR_ATTACHMENT0, GL.GL_RGBA8),
            (GL.GL_COLOR_ATTACHMENT1, GL.GL_R16UI),
            (GL.GL_DEPTH_ATTACHMENT, GL.GL_DEPTH_COMPONENT32F),
        ):
            buffer = GL.glGenRenderbuffers(1)
            GL.glBindRenderbuffer(GL.GL_RENDERBUFFER, buffer)
            GL.glRenderbufferStorage(GL.GL_RENDERBUFFER, form, width, height)
            GL.glFramebufferRenderbuffer(GL.GL_FRAMEBUFFER, attachment, GL.GL_RENDERBUFFER, buffer)

    def begin(self) -> None:
        """Bind, clear, and set the state every draw of a pass shares: reversed depth, no blending."""
        GL.glBindFramebuffer(GL.GL_FRAMEBUFFER, self._frame)
        GL.glDrawBuffers(2, [GL.GL_COLOR_ATTACHMENT0, GL.GL_COLOR_ATTACHMENT1])
        GL.glPixelStorei(GL.GL_PACK_ALIGNMENT, 1)
        GL.glViewport(0, 0, self.width, self.height)
        glClipControl(GL.GL_LOWER_LEFT, GL.GL_ZERO_TO_ONE)
        for switch in (GL.GL_BLEND, GL.GL_CULL_FACE, GL.GL_DITHER, GL.GL_MULTISAMPLE):
            GL.glDisable(switch)
        GL.glEnable(GL.GL_DEPTH_TEST)
        GL.glDepthMask(GL.GL_TRUE)
        GL.glDepthFunc(GL.GL_GREATER)
        GL.glProvokingVertex(GL.GL_LAST_VERTEX_CONVENTION)
        GL.glClearBufferfv(GL.GL_COLOR, 0, np.zeros(4, np.float32))
        GL.glClearBufferuiv(GL.GL_COLOR, 1, np.zeros(4, np.uint32))
        GL.glClearBufferfv(GL.GL_DEPTH, 0, np.zeros(1, np.float32))

    def read_depth(self) -> np.ndarray:
        """The depth buffer, (h, w) float32, first row on top."""
        depth = np.empty((self.height, self.width), np.float32)
        GL.glReadPixels(0, 0, self.width, self.height, GL.GL_DEPTH_COMPONENT, GL.GL_FLOAT, array=depth)
        return depth

    def read(self, wanted: Collection[Content]) -> dict[Content, np.ndarray]:
        """What is wanted of colour (h, w, 4) uint8, number (h, w) uint16, and depth buffer (h, w) float32.

        Raises:
            CameraError: the graphics library could not draw or read.
        """
        window, found = (0, 0, self.width, self.height), {}
        if "colour" in wanted:
            found["colour"] = np.empty((self.height, self.width, 4), np.uint8)
            GL.glReadBuffer(GL.GL_COLOR_ATTACHMENT0)
            GL.glReadPixels(*window, GL.GL_RGBA, GL.GL_UNSIGNED_BYTE, array=found["colour"])
        if "number" in wanted:
            found["number"] = np.empty((self.height, self.width), np.uint16)
            GL.glReadBuffer(GL.GL_COLOR_ATTACHMENT1)
            GL.glReadPixels(*window, GL.GL_RED_INTEGER, GL.GL_UNSIGNED_SHORT, array=found["number"])
        if "depth" in wanted:
            found["depth"] = self.read_depth()
        fault = GL.glGetError()
        if fault != GL.GL_NO_ERROR:
            raise CameraError(f"OpenGL reports error {fault:#06x} while drawing: try the other backend, or less memory")
        return found
