"""From a scene file, or the name of a built-in scene, to the mesh, camera and light of every frame."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field
from pathlib import Path

from shadowbench.config import (
    SceneConfig,
    apply_overrides,
    builtin_document,
    read_document,
    validate_document,
)
from shadowbench.errors import InputError
from shadowbench.geometry import Camera, ImageSize, Light, Mesh, Vector
from shadowbench.scenes import SCENES
from shadowbench.scenes.bodies import Body, join, load_body
from shadowbench.scenes.paths import curve_position
from shadowbench.scenes.procedural import ProceduralScene
from shadowbench.yaml_positions import Document

BIAS_OF_DIAGONAL = 1e-5
"""Automatic bias as a share of the bounding box's diagonal: the project's definition of shadow."""


@dataclass(frozen=True)
class CameraTrack:
    """The camera over time: key frames of a curve, and what stays the same."""

    eyes: Sequence[Vector]
    targets: Sequence[Vector]
    closed: bool
    up: Vector
    fov_y: float
    near: float
    far: float

    def at(self, frame: int, n_frames: int) -> Camera:
        """Camera at a frame."""
        eye, target = (curve_position(keys, frame, n_frames, self.closed) for keys in (self.eyes, self.targets))
        return Camera(eye, target, self.up, self.fov_y, self.near, self.far)


@dataclass(frozen=True)
class LightTrack:
    """The light over time: one light, or a point light's key positions."""

    light: Light
    keys: Sequence[Vector] = ()
    closed: bool = False

    def at(self, frame: int, n_frames: int) -> Light:
        """Light at a frame."""
        if not self.keys:
            return self.light
        return Light.point(*curve_position(self.keys, frame, n_frames, self.closed))


@dataclass(frozen=True, eq=False)
class Scene:
    """A scene, loaded.

    Attributes
    ----------
    name : name in results.
    path : the scene file, or None for a built-in scene.
    text : the scene file as it was read; for a built-in scene, the file that stands for it.
    config : everything that the file and the overrides say.
    image : pixels and samples per pixel.
    n_frames : number of frames; frames are numbered from 0.
    bias : world distance by which a sample must lie behind a triangle's plane to be shadowed by it.
    digests : sha256 of each mesh file by its path from the scene file, and of each generator's name and parameters.
    """

    name: str
    path: Path | None
    text: str
    config: SceneConfig
    image: ImageSize
    n_frames: int
    bias: float
    digests: dict[str, str]
    _bodies: tuple[Body, ...]
    _camera: CameraTrack
    _light: LightTrack
    _meshes: dict[int, Mesh] = field(repr=False)      # frame 0, and the frame asked for last

    def mesh(self, frame: int = 0) -> Mesh:
        """Geometry at a frame: always the same object where nothing moves. Arrays are read-only."""
        self._check_frame(frame)
        still = self._meshes[0]
        if frame in self._meshes or not any(body.poses for body in self._bodies):
            return self._meshes.get(frame, still)
        mesh = join(self._bodies, frame, still)
        self._meshes.clear()
        self._meshes.update({0: still, frame: mesh})
        return mesh

    def camera(self, frame: int = 0) -> Camera:
        """Camera at a frame."""
        self._check_frame(frame)
        return self._camera.at(frame, self.n_frames)

    def light(self, frame: int = 0) -> Light:
        """Light at a frame."""
        self._check_frame(frame)
        return self._light.at(frame, self.n_frames)

    def _check_frame(self, frame: int) -> None:
        """Refuse frames outside the sequence."""
        if not 0 <= frame < self.n_frames:
            raise IndexError(f"scene {self.name} has frames 0 to {self.n_frames - 1}, not {frame}")


def load_scene(path_or_name: str | Path, overrides: Iterable[str] = (), *, quick_height: int | None = None,
               text: str | None = None) -> Scene:
    """Load a scene.

    Parameters
    ----------
    path_or_name : a scene file, or the name of a built-in scene, which then has its defaults. A file of that name
        comes first.
    overrides : ``dotted.key=value`` settings that replace what the file says.
    quick_height : greatest image height; a higher image is scaled down to it. None leaves the size alone.
    text : the file's text, if it is already at hand.

    Raises
    ------
    InputError
        With everything that is wrong with the file (`ConfigErrors`), or what is wrong with a mesh or a frame.
    """
    path: Path | None = Path(path_or_name)
    if text is None and str(path_or_name) in SCENES and not Path(path_or_name).is_file():
        path, document = None, builtin_document(str(path_or_name))
    else:
        document = read_document(path_or_name, text)
    config = validate_document(apply_overrides(document, overrides))
    if quick_height is not None and config.image.height > quick_height:
        width = max(1, config.image.width * quick_height // config.image.height)
        image = config.image.model_copy(update={"width": width, "height": quick_height})
        config = config.model_copy(update={"image": image})
    return _build(config, path, document)


def _build(config: SceneConfig, path: Path | None, document: Document) -> Scene:
    """Load the geometry and check every frame."""
    file = document.file
    bodies: list[Body] = []
    digests: dict[str, str] = {}
    generated: ProceduralScene | None = None
    for i, entry in enumerate(config.geometry):
        try:
            body, made, digest = load_body(entry, config.frames, document.folder)
        except InputError as error:
            raise InputError(f"{file}: geometry[{i}]: {error}") from error
        bodies.append(body)
        digests.update(digest)
        generated = generated or made
    if not any(body.mesh.n_triangles for body in bodies):
        raise InputError(f"{file}: the scene has no triangles: add geometry")
    try:
        mesh = join(bodies, 0)
    except InputError as error:
        raise InputError(f"{file}: {error}") from error
    bias = BIAS_OF_DIAGONAL * mesh.diagonal() if config.bias == "auto" else float(config.bias)
    image = ImageSize(**config.image.model_dump())
    scene = Scene(config.name, path, document.text, config, image, config.frames, bias, digests, tuple(bodies),
                  _camera_track(config, generated), _light_track(config, generated), {0: mesh})
    _check_frames(scene, file)
    return scene


def _camera_track(config: SceneConfig, generated: ProceduralScene | None) -> CameraTrack:
    """Take the camera from the file, or else from the first generated scene."""
    if config.camera is not None:
        c, keys = config.camera, config.camera.key_frames()
        return CameraTrack([k.eye for k in keys], [k.target for k in keys], c.closed, c.up, c.fov_y, c.near, c.far)
    assert generated is not None        # validation asks for a camera where nothing is generated
    g = generated
    return CameraTrack(g.eyes, g.targets, g.closed, (0.0, 1.0, 0.0), g.fov_y, g.near, g.far)


def _light_track(config: SceneConfig, generated: ProceduralScene | None) -> LightTrack:
    """Take the light from the file, or else from the first generated scene."""
    light = config.light
    if light is None:
        assert generated is not None
        return LightTrack(generated.light)
    if light.direction is not None:
        return LightTrack(Light.directional(*light.direction))
    keys = light.path if light.path is not None else (light.position or (0.0, 0.0, 0.0),)
    return LightTrack(Light.point(*keys[0]), keys if light.path is not None else (), light.closed)


def _check_frames(scene: Scene, file: str) -> None:
    """Refuse a camera that looks nowhere, or a light on the camera, at any frame.

    Raises
    ------
    InputError
        Naming the first such frame.
    """
    aspect = scene.image.width / scene.image.height
    moving = len(scene._camera.eyes) > 1 or len(scene._light.keys) > 1
    for frame in range(scene.n_frames if moving else 1):
        camera, light = scene.camera(frame), scene.light(frame)
        try:
            camera.basis(aspect)
        except ValueError as error:
            raise InputError(f"{file}: frame {frame}: {error}") from error
        if not light.is_directional and light.position[:3] == camera.eye:
            raise InputError(f"{file}: frame {frame}: light on the camera: the light stands at the camera's eye, from "
                             "where no shadow can be seen; move one of them")
