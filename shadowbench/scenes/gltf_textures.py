"""Materials of a glTF file, with the textures that decide what they let through: beside the file or inside it."""

from __future__ import annotations

import base64
from pathlib import Path
from typing import Any
from urllib.parse import unquote

from shadowbench.errors import InputError
from shadowbench.geometry import Material, Texture, Wrap
from shadowbench.scenes.textures import REPEAT, embedded_texture, load_texture

_WRAPS: dict[int, Wrap] = {10497: "repeat", 33071: "clamp", 33648: "mirror"}
_SUFFIXES = {"image/png": ".png", "image/jpeg": ".jpg", "image/webp": ".webp"}
_CHUNK_HEADER = 8


class GltfFile:
    """What a glTF file's materials are read from.

    Parameters
    ----------
    header : the JSON part.
    rest : what follows it in a GLB file.
    path : the file, for messages and for what lies beside it.
    """

    def __init__(self, header: dict[str, Any], rest: bytes, path: Path) -> None:
        self.header, self.rest, self.path = header, rest, path
        self._textures: dict[int, Texture] = {}

    def material(self, index: int) -> Material:
        """Read a material: factors, alpha mode, and unless it is opaque its base colour texture.

        Raises
        ------
        InputError
            If a texture can't be used, or the opacity is not in 0..1.
        """
        material = self.header["materials"][index]
        surface = material.get("pbrMetallicRoughness", {})
        red, green, blue, alpha = (float(v) for v in surface.get("baseColorFactor", (1, 1, 1, 1)))
        color = (min(max(red, 0.0), 1.0), min(max(green, 0.0), 1.0), min(max(blue, 0.0), 1.0))
        mode, name = material.get("alphaMode", "OPAQUE"), str(material.get("name", f"material {index}"))
        if mode == "OPAQUE":
            return Material(name, color)
        if not 0.0 <= alpha <= 1.0:
            raise InputError(f"{self.path}: material '{name}' has the alpha {alpha:g}: give it one within 0..1")
        cutoff = float(material.get("alphaCutoff", 0.5)) if mode == "MASK" else None
        texture = None
        if "baseColorTexture" in surface:
            try:
                texture = self._texture(surface["baseColorTexture"])
            except InputError as error:
                raise InputError(f"{self.path}: material '{name}': {error}") from error
        return Material(name, color, alpha, texture, cutoff, texture)

    def _texture(self, reference: dict[str, Any]) -> Texture:
        """Read the texture that a material refers to."""
        if reference.get("texCoord", 0) != 0 or "KHR_texture_transform" in reference.get("extensions", {}):
            raise InputError("its base colour texture has a transform or a second set of coordinates: bake them into the "
                             "first set")
        index = reference["index"]
        if index not in self._textures:
            texture = self.header["textures"][index]
            source = texture.get("source", texture.get("extensions", {}).get("EXT_texture_webp", {}).get("source"))
            if source is None:
                raise InputError("its base colour texture has no image of a known kind: export it as PNG or JPEG")
            wrap = REPEAT
            if "sampler" in texture:
                sampler = self.header["samplers"][texture["sampler"]]
                wrap = (_WRAPS[sampler.get("wrapS", 10497)], _WRAPS[sampler.get("wrapT", 10497)])
            self._textures[index] = self._image(source, wrap)
        return self._textures[index]

    def _image(self, index: int, wrap: tuple[Wrap, Wrap]) -> Texture:
        """Read an image: a file, a data URI or part of a buffer."""
        image = self.header["images"][index]
        uri, name = image.get("uri"), f"{self.path.name}#image{index}"
        if uri is not None and not uri.startswith("data:"):
            loaded = load_texture(self.path.parent / unquote(uri), needs_alpha=False)
            return Texture(loaded.name, loaded.pixels, wrap)
        if uri is not None:
            kind, _, text = uri[5:].partition(",")
            data, mime = base64.b64decode(text), kind.split(";")[0]
        else:
            view = self.header["bufferViews"][image["bufferView"]]
            start = view.get("byteOffset", 0)
            data = self._buffer(view.get("buffer", 0))[start:start + view["byteLength"]]
            mime = image.get("mimeType", "image/png")
        return embedded_texture(data, _SUFFIXES.get(mime, ".png"), name, wrap)

    def _buffer(self, index: int) -> bytes:
        """Bytes of a buffer: the second chunk of a GLB file, a data URI, or a file."""
        uri = self.header["buffers"][index].get("uri")
        if uri is None:
            return self.rest[_CHUNK_HEADER:]
        if uri.startswith("data:"):
            return base64.b64decode(uri.partition(",")[2])
        return (self.path.parent / unquote(uri)).read_bytes()
