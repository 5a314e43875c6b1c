"""The codec against bytes that openpi wrote, and against frames that nobody should send."""

from contextlib import suppress

import msgpack
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra import numpy as npst

from policy.remote.msgpack_numpy import WireError, pack, unpack
from tests.support.openpi_peer import IMAGE, REQUEST, SERVER, STATE, payload_of


def same(a, b):
    if isinstance(a, np.ndarray | np.generic):
        return type(a) is type(b) and a.dtype == b.dtype and a.shape == b.shape and a.tobytes() == b.tobytes()
    if isinstance(a, dict):
        return a.keys() == b.keys() and all(same(a[key], b[key]) for key in a)
    if isinstance(a, list):
        return len(a) == len(b) and all(same(x, y) for x, y in zip(a, b, strict=True))
    return type(a) is type(b) and a == b


def test_a_request_is_packed_byte_for_byte_as_openpis_client_packs_it():
    images = {"observation/image": IMAGE, "observation/wrist_image": IMAGE + 1}
    request = {"observation/state": STATE, **images, "prompt": "pick up the can"}
    assert pack(request) == REQUEST


def test_metadata_of_openpis_server_are_read_and_written_as_it_writes_them():
    payload = payload_of(SERVER["metadata"])
    metadata = {
        "reset_pose": [0.0, 0.5],
        "robot": "g1",
        "gain": np.float64(2.0),
        "limits": np.array([[-1, 1]], dtype=np.int16),
    }
    assert pack(metadata) == payload
    # msgpack takes numpy's float64, which is a Python float, for one.
    assert same(unpack(payload), metadata | {"gain": 2.0})


def test_an_answer_of_openpis_server_is_read():
    answer = unpack(payload_of(SERVER["answer"]))
    assert sorted(answer) == ["actions", "policy_timing", "server_timing", "state"]
    assert same(answer["state"], STATE)
    assert same(answer["actions"], STATE + np.arange(2, dtype=np.float32)[:, None] / 64)
    assert same(answer["policy_timing"], {"infer_ms": np.float32(0.5)})


@pytest.mark.parametrize(
    "value",
    [
        None,
        [True, 3, -1.5, "text", b"bytes"],
        {"nested": {"array": np.arange(3)}, "list": [np.zeros((0, 2)), np.array(1.0)]},
        np.float32(1.5),
        np.int64(-3),
        np.bool_(True),
        np.array([True, False]),
        np.array(["ab", "cde"]),
        np.array([np.nan, np.inf, -np.inf]),
        np.arange(6, dtype=">i2").reshape(2, 3),
        np.arange(24, dtype=np.uint8).reshape(2, 3, 4)[:, ::-1, 1:],
    ],
)
def test_what_was_packed_is_unpacked(value):
    assert same(unpack(pack(value)), value)


@given(
    npst.arrays(st.one_of(npst.integer_dtypes(), npst.floating_dtypes(), npst.boolean_dtypes()), npst.array_shapes())
)
def test_every_array_of_numbers_survives_to_the_bit(array):
    assert same(unpack(pack(array)), array)


@given(st.binary(max_size=200))
def test_bytes_of_any_kind_are_read_or_refused(data):
    with suppress(WireError):
        unpack(data)


def array(**changes):
    entries = {"__ndarray__": True, "data": b"\0" * 8, "dtype": "<f4", "shape": [2]} | changes
    return msgpack.packb({key.encode(): value for key, value in entries.items() if value is not None})


@pytest.mark.parametrize(
    ("frame", "complaint"),
    [
        (array(dtype="|O", shape=[1]), "numbers, booleans and text travel"),
        (array(dtype="|O8", shape=[1]), "numbers, booleans and text travel"),
        (array(dtype="O", shape=[1]), "numbers, booleans and text travel"),
        (array(dtype="f4,O"), "numbers, booleans and text travel"),
        (array(dtype="|V8", shape=[1]), "numbers, booleans and text travel"),
        (array(dtype="<c8", shape=[1]), "numbers, booleans and text travel"),
        (array(dtype="(1000000,)f4"), "numbers, booleans and text travel"),
        (array(dtype=["<f4"]), "numbers, booleans and text travel"),
        (array(dtype="<f3"), "numpy knows no type '<f3'"),
        (array(dtype="<U0"), "has no content"),
        (array(dtype=None), "of the type None"),
        (array(shape=[3]), r"has 8 bytes; 12 are expected"),
        (array(shape=[1]), r"has 8 bytes; 4 are expected"),
        (array(shape=[-2]), "lengths are expected"),
        (array(shape=[True, 2]), "lengths are expected"),
        (array(shape=[2.0]), "lengths are expected"),
        (array(shape=[1] * 33), "up to 32 lengths"),
        (array(shape=[2**40, 2**40]), "bytes; 4835703278458516698824704 are expected"),
        (array(shape=[0, 2**62], data=b""), "too big|too large|Maximum"),
        (array(data="text"), "data of an array are str"),
        (msgpack.packb({b"__npgeneric__": True, b"data": [1], b"dtype": "<f4"}), "a scalar holds list"),
        (msgpack.packb({b"__npgeneric__": True, b"data": "x", b"dtype": "<f4"}), "a scalar of <f4 holds 'x'"),
        (msgpack.packb({b"__npgeneric__": True, b"data": 2**40, b"dtype": "|i1"}), r"a scalar of \|i1 holds"),
        (b"", "incomplete input"),
        (b"\xc1", "no MessagePack: FormatError"),
        (b"\x01\x02", "extra data"),
        (b"\x91" * 5000 + b"\x00", "no MessagePack: StackError"),
        (b"\xdd\xff\xff\xff\xff", "exceeds max_array_len"),
        (b"\xa2\xff\xff", "can't decode byte"),
        (b"\x81\x90\x01", "not allowed for map key"),
        (b"\xc7\x01\x05\x00", "the MessagePack extension 5"),
        (b"\x80\x04\x95\x0b\x00\x00\x00", "extra data"),  # how a pickle begins
    ],
)
def test_a_hostile_frame_is_refused_before_numpy_sees_it(frame, complaint):
    with pytest.raises(WireError, match=complaint):
        unpack(frame)


@pytest.mark.parametrize(
    ("value", "complaint"),
    [
        (object(), "object is no plain data"),
        (np.array([object()]), "an array of object cannot be sent"),
        (np.array([1j]), "an array of complex128 cannot be sent"),
        ({"deep": [2**70]}, "do not fit into a frame"),
    ],
)
def test_what_cannot_travel_is_not_sent(value, complaint):
    with pytest.raises(WireError, match=complaint):
        pack(value)
