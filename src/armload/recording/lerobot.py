"""LeRobot data sets as folders: meta/info.json, and episodes in Parquet files, one each (v2) or many in one (v3).

    v2   data/chunk-000/episode_000003.parquet, by the template `data_path` of meta/info.json
    v3   data/chunk-000/file-000.parquet; meta/episodes/*/*.parquet says in which file an episode is

Source: huggingface/lerobot, `datasets/lerobot_dataset.py` and `datasets/utils.py`.
"""

from __future__ import annotations

import hashlib
import json
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from armload.arms import Arm
from armload.errors import EpisodesError, RecordingError, one_line
from armload.recording.aliases import EPISODE
from armload.recording.column_spec import ColumnSpec
from armload.recording.header import read_name
from armload.recording.parquet_file import pyarrow_for, read_parquet
from armload.recording.recording import Recording

_INFO = Path("meta") / "info.json"
_CHUNK = 1000  # episodes of a chunk where meta/info.json does not say: LeRobot's own default
_PLACE = ("episode_index", "data/chunk_index", "data/file_index")


def is_data_set(path: str | Path) -> bool:
    """Whether a folder is a LeRobot data set."""
    return (Path(path) / _INFO).is_file()


def read_data_set(path: Path, where: str, arm: Arm | None = None, spec: ColumnSpec | None = None) -> Recording:
    """Read one episode of a LeRobot data set; see `read_recording` for what it raises.

    Elements of a vector that have names in meta/info.json are taken by them where they name the arm's joints, or where
    they say that one vector holds several quantities (`joint_1.pos`, `joint_1.vel`); else by their order.
    """
    spec = spec or ColumnSpec()
    info = _info(path)
    there = _places(path, where, info)
    episode = _chosen(list(there), spec, where)
    file = _file(path, info, there[episode])
    if not file.is_file():
        raise RecordingError(f"{where}: episode {episode} is in {file}, which is not there: download it, too")
    called = f"{where}, episode {episode}"
    return read_parquet(file, called, arm, spec.over(episode=episode), _elements(info, arm))


def data_set_episodes(path: str | Path) -> dict[int, Path]:
    """The episodes of a LeRobot data set, and the Parquet file that each of them is in.

    Raises:
        RecordingError: the data set's own files do not say.
    """
    path = Path(path)
    info = _info(path)
    return {episode: _file(path, info, places) for episode, places in _places(path, str(path), info).items()}


def data_set_columns(path: str | Path) -> str:
    """What a LeRobot data set says of its columns in meta/info.json, which the reading of every episode depends on.

    Raises:
        RecordingError: meta/info.json cannot be read.
    """
    return json.dumps(_info(Path(path)).get("features"), sort_keys=True)


def digests_of_episodes(file: Path) -> dict[int, str]:
    """SHA-256 of the rows of each episode of a Parquet file: they stay when episodes are added to the file.

    Pictures count for nothing. What a damaged file raises is pyarrow's.
    """
    pa, parquet = pyarrow_for(file)
    kept = [field.name for field in parquet.read_schema(file) if not _holds_bytes(pa, field.type)]
    table = parquet.read_table(file, columns=kept, use_threads=False).replace_schema_metadata()
    episodes = table.column(EPISODE).to_numpy()
    starts = np.flatnonzero(np.diff(episodes, prepend=np.nan))  # of stretches of rows of one episode
    found: dict[int, Any] = {}
    for start, stop in zip(starts, [*starts[1:], len(episodes)], strict=True):
        digest = found.setdefault(int(episodes[start]), hashlib.sha256())
        for name, column in zip(kept, table.slice(start, stop - start).columns, strict=True):
            values = pa.concat_arrays(column.chunks)  # however the file parts its rows
            digest.update(f"{name} {values.type}".encode())
            digest.update(pa.RecordBatch.from_arrays([values], [name]).serialize())
    return {episode: digest.hexdigest() for episode, digest in found.items()}


def _holds_bytes(pa: Any, kind: Any) -> bool:
    """Whether a column is of pictures, or of something else that is no number, text or list of them."""
    return pa.types.is_struct(kind) or pa.types.is_binary(kind) or pa.types.is_large_binary(kind)


def _places(path: Path, where: str, info: Mapping[str, Any]) -> dict[int, dict[str, int]]:
    """What `data_path` of meta/info.json asks for, of each episode."""
    template = str(info.get("data_path"))
    if "{episode_index" in template:
        size = _whole(info, "chunks_size", path, _CHUNK)
        count = _whole(info, "total_episodes", path)
        return {k: {"episode_index": k, "episode_chunk": k // size} for k in range(count)}
    if "{file_index" in template:
        index = _index(path, where)
        return {k: dict(zip(("chunk_index", "file_index"), index[k], strict=True)) for k in sorted(index)}
    raise RecordingError(
        f"{path / _INFO} has the data_path {template!r}: expected that of a LeRobot data set of version 2 or 3; "
        "convert it, or give the episode's Parquet file"
    )


def _file(path: Path, info: Mapping[str, Any], places: Mapping[str, int]) -> Path:
    template = str(info.get("data_path"))
    try:
        return path / template.format(**places)
    except (KeyError, ValueError, IndexError, AttributeError):
        raise RecordingError(f"{path / _INFO} has the data_path {template!r}: expected only {sorted(places)}") from None


def _info(path: Path) -> dict[str, Any]:
    try:
        info = json.loads((path / _INFO).read_text(encoding="utf-8"))
    except (OSError, ValueError, RecursionError) as error:
        raise RecordingError(f"{path / _INFO} cannot be read: {one_line(error)[:160]}") from None
    if not isinstance(info, dict):
        raise RecordingError(f"{path / _INFO} holds no table: expected that of a LeRobot data set")
    return info


def _whole(info: Mapping[str, Any], key: str, path: Path, default: int | None = None) -> int:
    value = info.get(key, default)
    if not isinstance(value, int) or value < 1:
        raise RecordingError(f"{path / _INFO}: {key} is {value!r}: expected a whole number of at least 1")
    return value


def _index(path: Path, where: str) -> dict[int, tuple[int, int]]:
    """Chunk and file of each episode (v3)."""
    _, parquet = pyarrow_for(where)
    found: dict[int, tuple[int, int]] = {}
    for file in sorted((path / "meta" / "episodes").rglob("*.parquet")):
        try:
            table = parquet.read_table(file, columns=list(_PLACE), use_threads=False)
            columns = [table.column(name).to_pylist() for name in _PLACE]
        except Exception as error:  # a damaged file can fail anywhere in the decoder
            raise RecordingError(f"{file} does not say where episodes are: {one_line(error)[:160]}") from None
        found.update({episode: (chunk, number) for episode, chunk, number in zip(*columns, strict=True)})
    if not found:
        raise RecordingError(
            f"{where} has no episodes in meta/episodes: expected them in a LeRobot data set of version 3"
        )
    return found


def _chosen(there: Sequence[int], spec: ColumnSpec, where: str) -> int:
    """The episode that was asked for, or the only one."""
    shown = f"{there[0]}" if len(there) == 1 else f"{there[0]} … {there[-1]}"
    if spec.episode is None and len(there) > 1:
        message = f"{where} holds {len(there)} episodes ({shown}): expected one; name it with --episode K"
        raise EpisodesError(message, tuple(there))
    if spec.episode is not None and spec.episode not in there:
        raise RecordingError(f"{where} has no episode {spec.episode}: expected one of {shown}")
    return there[0] if spec.episode is None else spec.episode


def _elements(info: Mapping[str, Any], arm: Arm | None) -> dict[str, list[str]]:
    """The names of the elements of vectors that hold several quantities, or joints by the arm's names."""
    features = info.get("features")
    found: dict[str, list[str]] = {}
    for feature, about in features.items() if isinstance(features, dict) else ():
        names = about.get("names") if isinstance(about, dict) else None
        if isinstance(names, dict) and len(names) == 1:  # such as {"motors": [...]}
            (names,) = names.values()
        if not isinstance(names, list) or not all(isinstance(name, str) for name in names):
            continue
        bare = [name.partition(".")[0] for name in names]  # of panda_joint1.pos
        readings = [read_name(name, ()) for name in names]
        if len({reading.quantity for reading in readings if reading is not None}) > 1:
            found[feature] = names
        elif arm is not None and set(arm.joint_names) <= set(bare) and len(set(bare)) == len(bare):
            found[feature] = bare
    return found
