"""The files of a frame's images."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence

from cosim.capture.products import camera_of, content_of
from cosim.drives.kitti.images import encode_depth, encode_gray, encode_instances, encode_rgb
from sensors.cameras import Images, semantic_image

_ENCODERS: Mapping[str, Callable[[Images, tuple[str, ...]], bytes]] = {
    "gray": lambda images, _: encode_gray(images.gray),
    "colour": lambda images, _: encode_rgb(images.rgb),
    "depth": lambda images, _: encode_depth(images.depth_m),
    "semantic": lambda images, kinds: encode_gray(semantic_image(images, kinds)),
    "instance": lambda images, _: encode_instances(images.instance),
}


def encode_products(
    products: Sequence[str], images: Mapping[int, Images], kinds: tuple[str, ...], name: str
) -> dict[str, bytes]:
    """Files of a frame, by path.

    Args:
        products: folders, as `cosim.capture.products.PRODUCTS` lists them.
        images: by number of camera.
        kinds: of the instances in them.
        name: of the frame.
    """
    return {
        f"{product}/{name}.png": _ENCODERS[content_of(product)](images[camera_of(product)], kinds)
        for product in products
    }
