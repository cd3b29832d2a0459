"""Encode the images of a frame as files."""

from __future__ import annotations

from collections.abc import Callable, Collection, Mapping, Sequence

from cosim.capture.products import camera_of, kind_of
from cosim.drives.kitti.images import encode_depth, encode_gray, encode_instances, encode_rgb
from sensors.cameras import Images, semantic_image

_ENCODERS: Mapping[str, Callable[[Images, tuple[str, ...]], bytes]] = {
    "gray": lambda images, _: encode_gray(images.gray),
    "image": lambda images, _: encode_rgb(images.rgb),
    "depth": lambda images, _: encode_depth(images.depth_m),
    "semantic": lambda images, kinds: encode_gray(semantic_image(images, kinds)),
    "instance": lambda images, _: encode_instances(images.instance),
}


def encode_products(
    products: Sequence[str], images: Mapping[str, Images], gray: Collection[str], types: tuple[str, ...], name: str
) -> dict[str, bytes]:
    """Encode the images of a frame; returns file contents by path.

    Args:
        products: names of the image folders.
        images: images by camera.
        gray: names of the grayscale cameras.
        types: kinds of the instances in the images.
        name: name of the frame.
    """
    files = {}
    for product in products:
        kind, camera = kind_of(product), camera_of(product)
        encode = _ENCODERS["gray" if kind == "image" and camera in gray else kind]
        files[f"{product}/{name}.png"] = encode(images[camera], types)
    return files
