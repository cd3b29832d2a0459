"""Which images a frame keeps: of what, seen by which camera of the rig."""

from __future__ import annotations

from collections.abc import Collection, Sequence

from sensors.cameras import Content

_KINDS = ("image", "depth", "semantic", "instance")


def check_products(products: Sequence[str], cameras: Sequence[str]) -> None:
    """Raise ValueError where a name is no image folder of these cameras, or is there twice."""
    for product in products:
        kind, _, camera = product.partition("_")
        if kind not in _KINDS or camera not in cameras:
            raise ValueError(
                f"{product!r} is no image: give image_, depth_, semantic_ or instance_ with a camera's name, one of "
                f"{', '.join(cameras)}"
            )
        if products.count(product) > 1:
            raise ValueError(f"{product!r} is there twice; keep one")


def cameras_of(products: Collection[str]) -> tuple[str, ...]:
    """Names of the cameras that some products need, sorted."""
    return tuple(sorted({camera_of(product) for product in products}))


def camera_of(product: str) -> str:
    """Name of the camera that a product shows."""
    return product.partition("_")[2]


def wanted_of(camera: str, products: Collection[str]) -> frozenset[Content]:
    """What a camera must read back for those of some products that it shows."""
    read: dict[str, tuple[Content, ...]] = {
        "image": ("colour",),
        "depth": ("depth",),
        "semantic": ("colour", "number"),
        "instance": ("number",),
    }
    return frozenset(part for name in products if camera_of(name) == camera for part in read[kind_of(name)])


def kind_of(product: str) -> str:
    """What a product shows: `image`, `depth`, `semantic` or `instance`."""
    return product.partition("_")[0]
