"""Image folders of a frame: the content and the camera of each."""

from __future__ import annotations

from collections.abc import Collection, Sequence

from sensors.cameras import Content

_KINDS = ("image", "depth", "semantic", "instance")


def check_products(products: Sequence[str], cameras: Sequence[str]) -> None:
    """Raise ValueError if a name is not an image folder of these cameras, or is listed twice."""
    for product in products:
        kind, _, camera = product.partition("_")
        if kind not in _KINDS or camera not in cameras:
            raise ValueError(
                f"{product!r} is not an image folder: give image_, depth_, semantic_ or instance_ followed by a "
                f"camera, one of {', '.join(cameras)}"
            )
        if products.count(product) > 1:
            raise ValueError(f"{product!r} is listed twice; keep one")


def cameras_of(products: Collection[str]) -> tuple[str, ...]:
    """Names of the cameras that the products need, sorted."""
    return tuple(sorted({camera_of(product) for product in products}))


def camera_of(product: str) -> str:
    """Name of a product's camera."""
    return product.partition("_")[2]


def wanted_of(camera: str, products: Collection[str]) -> frozenset[Content]:
    """Image contents that a camera must render for its products."""
    contents: dict[str, tuple[Content, ...]] = {
        "image": ("colour",),
        "depth": ("depth",),
        "semantic": ("colour", "number"),
        "instance": ("number",),
    }
    return frozenset(part for name in products if camera_of(name) == camera for part in contents[kind_of(name)])


def kind_of(product: str) -> str:
    """Content of a product: `image`, `depth`, `semantic` or `instance`."""
    return product.partition("_")[0]
