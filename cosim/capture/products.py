"""Which images a frame keeps: of what, seen by which of the four cameras of KITTI's rig."""

from __future__ import annotations

from collections.abc import Sequence

from sensors.cameras import Content

PRODUCTS = tuple(f"{kind}_{camera}" for kind in ("image", "depth", "semantic", "instance") for camera in range(4))
"""The folders. Cameras 0 (left) and 1 (right) are grayscale, 2 (left) and 3 (right) see colour."""


_GRAY_CAMERAS = (0, 1)


def check_products(products: Sequence[str]) -> None:
    """Raise ValueError where a name is no image folder, or is there twice."""
    for product in products:
        if product not in PRODUCTS:
            raise ValueError(
                f"{product!r} is no image: give image_, depth_, semantic_ or instance_ with a camera's number, 0 to 3"
            )
        if products.count(product) > 1:
            raise ValueError(f"{product!r} is there twice; keep one")


def cameras_of(products: Sequence[str]) -> tuple[int, ...]:
    """Numbers of the cameras that some products need, sorted."""
    return tuple(sorted({camera_of(product) for product in products}))


def camera_of(product: str) -> int:
    """Number of the camera that a product shows."""
    return int(product.rpartition("_")[2])


def wanted_of(number: int, products: Sequence[str]) -> frozenset[Content]:
    """What a camera must read back for those of some products that it shows."""
    read: dict[str, tuple[Content, ...]] = {
        "gray": ("colour",),
        "colour": ("colour",),
        "depth": ("depth",),
        "semantic": ("colour", "number"),
        "instance": ("number",),
    }
    return frozenset(part for name in products if camera_of(name) == number for part in read[content_of(name)])


def content_of(product: str) -> str:
    """What a product shows: `gray`, `colour`, `depth`, `semantic` or `instance`."""
    kind = product.rpartition("_")[0]
    if kind != "image":
        return kind
    return "gray" if camera_of(product) in _GRAY_CAMERAS else "colour"
