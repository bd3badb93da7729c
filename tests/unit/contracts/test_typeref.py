from collections.abc import Sequence
from typing import Annotated, Any, Literal

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from gap_runtime.contracts.types import CAMERA, CONTRACT_TYPES, SCALAR_TYPES, WORLD, Mask, PointCloud, Se3Pose
from gap_runtime.contracts.types.geometry import FRAMES
from gap_runtime.contracts.types.typeref import TypeRef

flags = {"is_list": st.booleans(), "optional": st.booleans()}
framed = st.builds(TypeRef, st.sampled_from(sorted(CONTRACT_TYPES)), st.none() | st.sampled_from(FRAMES), **flags)
refs = framed | st.builds(TypeRef, st.sampled_from([*SCALAR_TYPES, "any"]), **flags)


@given(refs)
def test_text_reads_back_as_what_it_was(ref):
    assert TypeRef.parse(str(ref)) == ref


@pytest.mark.parametrize(
    ("annotation", "text"),
    [
        (Mask, "Mask"),
        (float, "float"),
        (str, "string"),
        (Any, "any"),
        (dict, "any"),
        (dict[str, float], "any"),
        (list[Mask], "Mask[]"),
        (tuple[Mask, ...], "Mask[]"),
        (tuple[float, float, float], "float[]"),
        (Sequence[int], "int[]"),
        (Mask | None, "Mask?"),
        (list[Mask] | None, "Mask[]?"),
        (Annotated[PointCloud, WORLD], "PointCloud[world]"),
        (Annotated[PointCloud | None, CAMERA], "PointCloud[camera]?"),
        (list[Annotated[Se3Pose, WORLD]], "Se3Pose[world][]"),
        (Annotated[Mask, "a note that is no frame"], "Mask"),
    ],
)
def test_an_annotation_is_a_type(annotation, text):
    assert str(TypeRef.of(annotation)) == text


@pytest.mark.parametrize(
    "annotation",
    [np.ndarray, bytes, object, Mask | PointCloud, int | str | None, list, tuple[float, str], tuple[()],
     list[list[float]], list[Mask | None], Literal["a"], None],
    ids=str,
)  # fmt: skip
def test_what_no_contract_can_carry_is_refused(annotation):
    with pytest.raises(TypeError):
        TypeRef.of(annotation)


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("", "not a type"),
        ("Mask[", "not a type"),
        ("Mask?[]", "not a type"),
        ("Mask[][]", "not a type"),
        ("Mask[world", "not a type"),
        ("list[Mask]", "'list' is not a contract type"),
        ("mask", "did you mean 'Mask'"),
        ("PointClod[world]", "did you mean 'PointCloud'"),
        ("Mask[wrold]", "did you mean 'world'"),
        ("Mask[m]", "'m' is not a frame"),
        ("float[world]", "not expressed in any frame"),
        ("any[world]", "not expressed in any frame"),
        ("Mask\n", None),
        (" float ", None),
    ],
)
def test_a_misspelt_type_says_what_is_wrong(text, said):
    if said is None:
        assert TypeRef.parse(text).name == text.strip()
        return
    with pytest.raises(ValueError, match=said):
        TypeRef.parse(text)


@given(refs)
def test_every_type_accepts_itself_and_what_is_surely_there(ref):
    assert ref.accepts(ref)
    assert TypeRef(ref.name, ref.frame, ref.is_list, True).accepts(ref)


@pytest.mark.parametrize(
    ("into", "value", "may"),
    [
        ("float", "int", True),
        ("int", "float", False),
        ("float[]", "int[]", True),
        ("float", "float?", False),
        ("float?", "float", True),
        ("Mask", "Mask[]", False),
        ("Mask", "PointCloud", False),
        ("PointCloud", "PointCloud[world]", True),
        ("PointCloud[world]", "PointCloud", True),
        ("PointCloud[world]", "PointCloud[camera]", False),
        ("any", "Mask[]?", True),
        ("Mask", "any", True),
        ("bool", "int", False),
        ("string", "Mask", False),
    ],
)
def test_what_may_flow_where(into, value, may):
    assert TypeRef.parse(into).accepts(TypeRef.parse(value)) is may
