import json
import subprocess
import sys
from pathlib import Path

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from ruamel.yaml import YAML

from shadowbench.algorithms import ALGORITHMS
from shadowbench.config import (
    ConfigErrors,
    SceneConfig,
    apply_overrides,
    load_config,
    parse_algorithm_spec,
    read_document,
    resolved_yaml,
    scene_schema,
    template,
    validate_params,
)
from shadowbench.errors import InputError
from shadowbench.scenes import SCENES
from tests import config_examples
from tests.config_examples import CAMERA, FULL, LIGHT, MESH, QUAD, one_error
from tests.scene_examples import SampleParams

examples, folder = config_examples.examples, config_examples.folder      # fixtures


# Overrides

def test_overrides_replace_and_add(folder):
    document = read_document(folder / "s.yaml", FULL)
    before = json.dumps(document.value)
    overrides = ["image.width=64", "geometry.1.triangles=500", "geometry[0].scale=[1, 2, 4]", "algorithms=[sample]",
                 "matrix.sample.branching=[4, 8]", "camera.eye.2=7"]
    config = load_config(folder / "s.yaml", overrides, text=FULL)
    assert config.image.width == 64 and config.geometry[1].triangles == 500 and config.geometry[0].scale == (1, 2, 4)
    assert config.selections() == [("sample", {})] and config.matrix["sample.branching"] == (4, 8)
    assert config.camera.eye == (0, 0, 7)
    assert load_config(folder / "s.yaml", ["image.samples=2"], text=QUAD).image.samples == 2
    apply_overrides(document, ["image.width=64"])
    assert json.dumps(document.value) == before and not document.overrides


def test_an_override_mends_what_it_replaces(folder):
    assert load_config(folder / "s.yaml", ["bias=0"], text=QUAD + "bias: .nan").bias == 0


@pytest.mark.parametrize(("override", "expected"), [
    ("image.widht=64", "-D image.widht=64: image.widht unknown key; did you mean 'width'?"),
    ("image.width=0", "-D image.width=0: image.width must be at least 1, not 0"),
    ("image={width: x}", "-D image={width: x}: image.width must be a whole number, not the text 'x'"),
    ("image.width", "-D image.width: write it as key=value"),
    ("=3", "-D =3: write it as key=value"),
    ("image.width=", "-D image.width=: the value is missing"),
    ("image.width=[1", "-D image.width=[1: YAML: expected ',' or ']', but got '<stream end>'"),
    ("image..width=1", "-D image..width=1: 'image..width' is no dotted key such as geometry.0.scale"),
    ("geometry.5.scale=1", "-D geometry.5.scale=1: geometry is a list of 1: '5' is not one of its indices from 0"),
    ("geometry.scale=1", "-D geometry.scale=1: geometry is a list of 1: 'scale' is not one of its indices from 0"),
    ("frames.x=1", "-D frames.x=1: frames has no key 'x': it is no mapping"),
    ("image[0]=1", "-D image[0]=1: image has no key '0': it is no list"),
    ("bogus=1", "-D bogus=1: bogus unknown key; known: name, geometry, camera, light, image, frames, bias, "
                "algorithms, matrix"),
])
def test_bad_overrides_are_named(override, expected, folder):
    assert one_error(QUAD + "frames: 2\nimage: {width: 3}", folder, [override]) == expected


# Algorithm specifications

@pytest.mark.parametrize(("text", "name", "params"), [
    ("sample", "sample", {}),
    ("sample[]", "sample", {}),
    (" sample [ branching = 16 , casters=back_faces ] ", "sample", {"branching": 16, "casters": "back_faces"}),
    ("sample[slopes=[1, 2.5],branching=8]", "sample", {"slopes": [1, 2.5], "branching": 8}),
    ("sample[resolution='auto']", "sample", {"resolution": "auto"}),
    ("optional[anything=1]", "optional", {"anything": 1}),
])
def test_algorithm_specs(text, name, params):
    assert parse_algorithm_spec(text) == (name, params)


@pytest.mark.parametrize(("text", "expected"), [
    ("", ["-a : write it as name or 'name[key=value,...]'"]),
    ("sample[branching=3", ["-a sample[branching=3: write it as name or 'name[key=value,...]'"]),
    ("sampel", ["-a sampel: unknown algorithm 'sampel'; did you mean 'sample'?"]),
    ("sample[16]", ["-a sample[16]: '16' is not key=value"]),
    ("sample[branching=]", ["-a sample[branching=]: branching: the value is missing"]),
    ("sample[branching=2,branching=4]", ["-a sample[branching=2,branching=4]: branching is given twice"]),
    ("sample[branching=x,caster=all]", [
        "-a sample[branching=x,caster=all]: branching must be a whole number, not the text 'x'",
        "-a sample[branching=x,caster=all]: caster unknown parameter of sample; did you mean 'casters'?"]),
    ("sample[branching=6]", ["-a sample[branching=6]: branching is no power of two"]),
])
def test_bad_algorithm_specs(text, expected):
    with pytest.raises(InputError) as caught:
        parse_algorithm_spec(text)
    assert str(caught.value).splitlines() == expected


@given(st.text("sample[]=,'\"{}: 3x", max_size=30))
@settings(deadline=None, max_examples=200, suppress_health_check=[HealthCheck.function_scoped_fixture])
def test_any_algorithm_spec_is_read_or_refused(text):
    try:
        name, _ = parse_algorithm_spec(text)
    except InputError as error:
        assert str(error).startswith("-a ")
    else:
        assert name in ALGORITHMS


def test_parameters_are_validated_strictly():
    assert validate_params("sample", {"branching": 8, "slopes": [1, 2]}) == SampleParams(branching=8, slopes=(1, 2))
    with pytest.raises(InputError, match=r"^sample: branching must be a whole number, not true$"):
        validate_params("sample", {"branching": True})


# Writing back

@pytest.mark.parametrize("text", [FULL, QUAD, MESH + CAMERA + LIGHT,
                                  MESH + "camera: {path: [{eye: [0, 0, 5], target: [0, 0, 0]}], closed: true}\n"
                                         "light: {direction: [0, -1, 1e-7]}\nbias: 1e-7"])
def test_resolved_files_read_back_as_the_same_scene(text, folder):
    config = load_config(folder / "s.yaml", text=text)
    resolved = resolved_yaml(config)
    again = load_config("elsewhere/t.yaml", text=resolved)
    assert resolved_yaml(again) == resolved
    assert again.model_dump(exclude={"algorithms", "geometry"}) == config.model_dump(exclude={"algorithms", "geometry"})
    assert [g.scale for g in again.geometry] == [g.scale for g in config.geometry]


@pytest.mark.parametrize("name", ["a: b #.obj", ": a.obj", "n\x85l  x\ty.obj", "'q\".obj", "é😀.obj",
                                  "- [x" + "  y" * 70])
def test_odd_file_names_survive(name, tmp_path):
    (tmp_path / name).write_text("")
    scene = {"geometry": [{"mesh": name}], "camera": {"eye": [0, 0, 5], "target": [0, 0, 0]},
             "light": {"position": [0, 5, 0]}}
    text = json.dumps(scene, ensure_ascii=False).replace("\x85", "\\N")
    config = load_config(tmp_path / "s.yaml", text=text)
    assert load_config("t.yaml", text=resolved_yaml(config)).geometry[0].mesh == str(tmp_path / name)


def test_resolved_files_fill_in_every_default(folder):
    resolved = YAML(typ="safe", pure=True).load(resolved_yaml(load_config(folder / "s.yaml", text=FULL)))
    assert resolved["algorithms"][1] == {"sample": {"branching": 16, "casters": "back_faces", "slopes": [0.0, 1.0],
                                                    "resolution": "auto"}}
    assert resolved["geometry"][0]["mesh"] == str(folder / "a.obj")
    short = YAML(typ="safe", pure=True).load(resolved_yaml(load_config(folder / "s.yaml", text=QUAD)))
    assert short["name"] == "s"
    assert short["image"] == {"width": 1024, "height": 1024, "samples": 1, "layers": 1, "sampling": "surface"}
    assert short["geometry"][0]["triangles"] == 2 and short["geometry"][0]["seed"] == 1 and short["bias"] == "auto"


# Schema, templates, configurations

def test_the_schema_names_every_key():
    schema = scene_schema()
    json.dumps(schema)
    assert list(schema["properties"]) == list(SceneConfig.model_fields) and schema["required"] == ["geometry"]
    assert schema["additionalProperties"] is False
    assert "quad" in schema["$defs"]["GenerateEntry"]["properties"]["generate"]["enum"]
    assert schema["$defs"]["AlgorithmSpec"]["anyOf"][0]["enum"] == list(ALGORITHMS)
    assert schema["$defs"]["ImageConfig"]["properties"]["samples"]["enum"] == [1, 2, 4, 8, 16]


@pytest.mark.parametrize("name", ["citadel", "quad", "my scene"])
def test_templates_validate_as_written(name):
    config = load_config(f"{name}.yaml", text=template(name))
    assert config.geometry[0].generate == (name if name in SCENES else "citadel")
    assert config.name == name.replace(" ", "_")


def test_what_a_template_comments_out_is_valid_too(folder):
    import re

    text = re.sub(r"^# ?(?=- mesh|  |camera|light|algorithms|matrix)", "", template(), flags=re.MULTILINE)
    text = re.sub(r"^#.*\n|^ *shadowbench.*\n", "", text, flags=re.MULTILINE)
    text = re.sub(r"^(?=- mesh|  (?:scale|rotate|translate|material|animate))", "  ", text, flags=re.MULTILINE)
    config = load_config(folder / "t.yaml", text=text.replace("models/chair.obj", "a.obj"))
    assert len(config.geometry) == 2 and config.camera is not None and config.light is not None
    assert config.algorithms is not None and config.geometry[1].animate is not None


CONFIGS = sorted(p for p in (Path(__file__).parent.parent / "configs").glob("*.yaml") if p.stem != "ci")


@pytest.mark.parametrize("file", CONFIGS, ids=lambda f: f.stem)
def test_committed_configurations_validate(file):
    config = load_config(file)
    assert config.name == file.stem
    resolved_yaml(config)


def test_reading_a_scene_file_imports_no_heavy_package(folder):
    code = ("import sys; from shadowbench.config import load_config, scene_schema, resolved_yaml, template\n"
            "c = load_config('x.yaml', text=template()); resolved_yaml(c); scene_schema()\n"
            "print([m for m in ('numba', 'matplotlib', 'trimesh', 'scipy', 'numpy') if m in sys.modules])")
    out = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert out.stdout.strip() == "[]"


# Mutation

_TOKENS = ["", "null", "true", "-1", "0", "1e400", ".nan", "'x'", "[]", "{}", "[1, 2]", "&a", "*a", "!x", "<<", "- ",
           ": ", "\t", "\x00", "é", "\n", "  ", "{", "]", "'", '"', "%", "?", "|", "9" * 30, "0x" + "f" * 5000, "#"]


@st.composite
def mutated(draw) -> str:
    """A full scene file with up to four pieces replaced, doubled or dropped."""
    text = FULL
    for _ in range(draw(st.integers(1, 4))):
        start = draw(st.integers(0, len(text)))
        end = min(len(text), start + draw(st.integers(0, 12)))
        piece = draw(st.sampled_from(_TOKENS) | st.text(max_size=3) | st.just(text[start:end] * 2))
        text = text[:start] + piece + text[end:]
    return text


@given(mutated())
@settings(deadline=None, max_examples=200, suppress_health_check=[HealthCheck.function_scoped_fixture])
def test_mutated_files_are_read_or_refused(folder, text):
    try:
        config = load_config(folder / "s.yaml", text=text)
    except ConfigErrors as error:
        assert error.lines
        for line in error.lines:
            assert line.startswith(f"{folder}/s.yaml:") and "\n" not in line
    else:
        assert isinstance(config, SceneConfig)
        resolved = resolved_yaml(config)
        assert resolved_yaml(load_config(folder / "s.yaml", text=resolved)) == resolved


@given(st.recursive(st.none() | st.booleans() | st.integers() | st.floats() | st.text(max_size=4),
                    lambda inner: st.lists(inner, max_size=3) | st.dictionaries(
                        st.sampled_from(["mesh", "generate", "path", "eye", "frame", "animate", "x"]), inner,
                        max_size=3), max_leaves=6),
       st.sampled_from(["geometry", "geometry.0", "geometry.0.animate", "geometry.0.material", "camera", "camera.path",
                        "light", "light.path", "image", "frames", "bias", "algorithms", "algorithms.1.sample", "matrix",
                        "name", "matrix.sample.slopes"]))
@settings(deadline=None, max_examples=200, suppress_health_check=[HealthCheck.function_scoped_fixture])
def test_any_value_anywhere_is_read_or_refused(folder, value, key):
    override = f"{key}={json.dumps(value)}"
    try:
        load_config(folder / "s.yaml", [override], text=FULL)
    except ConfigErrors as error:
        assert all("\n" not in line for line in error.lines)
