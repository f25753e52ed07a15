"""What the empty stretches of a survey teach: a profile of each arm, and never anything that it may have held.

A profile is learned from an arm's first sessions, then goes on session by session, each only if it fits what is known:
an arm that was exchanged or repaired is another one, and is not averaged with it.
"""

from __future__ import annotations

import json
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from armload.arms import Arm
from armload.errors import ArmloadError
from armload.identification import check_usable
from armload.inertia import NAMES
from armload.lab.cells import key_of
from armload.online.thresholds import LEARN_FROM
from armload.posterior import Profile, check_new, learn_profile, save_profile
from armload.posterior.profile_agreement import DisagreementError
from armload.posterior.profile_learning import by_clock
from armload.posterior.profile_session import check_fits
from armload.recording import Recording
from armload.runtime.atomic import replacing
from armload.survey.answering import on_this_machine
from armload.survey.logs import Log
from armload.survey.rows import ANSWERED, SEPARATOR
from armload.survey.settings import Settings

# sessions that a profile is learned from at once: twice what its capacity is chosen from, and few enough that an arm is
# seldom exchanged meanwhile
FIRST = 8
# sessions at most, an even choice of those after the first: what a session adds becomes small, its cost does not
MOST = 20


def learn_profiles(
    rows: Sequence[dict[str, Any]], settings: Settings, folder: str | Path, say: Callable[[str], None] = lambda _: None
) -> dict[str, str]:
    """Write `folder/ARM.profile` for every arm that was seen empty for long enough, and say of each what was done.

    Beside it lies `ARM.json`: the stretches it was learned from, those that did not fit, and a key; an arm whose
    stretches are the same is not learned again.

    Args:
        rows: of a survey. settings: with which it was made. say: called with what is being done.

    Raises:
        OSError: the folder cannot be written.
    """
    folder = Path(folder)
    folder.mkdir(parents=True, exist_ok=True)
    arms = sorted({row["arm"] for row in rows} - {""})  # what --arm-of does not fit is nobody's
    return {arm: _of_arm(arm, rows, settings, folder, say) for arm in arms}


def empty_stretches(rows: Sequence[dict[str, Any]]) -> list[dict[str, Any]]:
    """The rows that a profile may learn from, the oldest first: empty beyond doubt, and `LEARN_FROM` long."""
    found = [
        row
        for row in rows
        if row["status"] == ANSWERED
        and not row["held"]
        and NAMES[0] in row["determined"].split(SEPARATOR)
        and row["mass_low"] <= 0.0 <= row["mass_high"]
        and row["t1"] - row["t0"] >= LEARN_FROM
        and not (row["moves"] or row.get("changed"))
    ]
    return sorted(found, key=lambda row: (row["date"] is None, row["date"] or 0.0, row["log"], row["part"]))


def _of_arm(
    arm: str, rows: Sequence[dict[str, Any]], settings: Settings, folder: Path, say: Callable[[str], None]
) -> str:
    stretches = empty_stretches([row for row in rows if row["arm"] == arm])
    if not stretches:
        return f"none, as it was never seen empty for {LEARN_FROM:g} s"
    later = stretches[FIRST:]
    step = max(-(-len(later) // (MOST - FIRST)), 1)
    chosen = [*stretches[:FIRST], *later[::step]]
    path, about = (Path(f"{folder}/{arm}{suffix}") for suffix in (".profile", ".json"))  # where `{arm}` is looked for
    key = key_of([[row["key"], row["t0"], row["t1"]] for row in chosen])
    before = _learned_from(about, key)
    if before is not None and path.is_file():
        return f"as before, of {before} stretches"
    say(f"learning the profile of {arm} from {len(chosen)} stretches")
    profile, learned, left_out = _learned(chosen, settings)
    if profile is None:
        return f"none, as no stretch could be used ({left_out[0]['reason']})"
    save_profile(profile, path)
    with replacing(about) as temporary:
        whole = {"key": key, "learned_from": learned, "left_out": left_out}
        temporary.write_text(json.dumps(whole, indent=1) + "\n", encoding="utf-8")
    return f"learned from {len(learned)} stretches" + (f", {len(left_out)} did not fit" if left_out else "")


def _learned_from(about: Path, key: str) -> int | None:
    """How many stretches what lies in a folder was learned from; None: of others, or nobody can read it any more."""
    try:
        before = json.loads(about.read_text(encoding="utf-8"))
        return len(before["learned_from"]) if before["key"] == key else None
    except (FileNotFoundError, ValueError, KeyError, TypeError, RecursionError):
        return None


def _learned(
    chosen: Sequence[dict[str, Any]], settings: Settings
) -> tuple[Profile | None, list[dict[str, Any]], list[dict[str, Any]]]:
    arm, tool = settings.arm(), settings.mounted()
    mounted = None if tool is None else arm.in_frame(tool.parameters).phi
    first: list[Recording] = []
    profile, learned, left_out = None, [], []
    for k, row in enumerate(chosen):
        place = {"log": row["log"], "t0": row["t0"], "t1": row["t1"]}
        try:
            log = _stretch(row, settings)
            check_usable(log, arm)
            if k < FIRST:
                check_new([*first, log], None)
                first.append(log)
            else:
                assert profile is not None
                check_fits(profile, arm, log, mounted)
                profile = learn_profile(arm, [log], [mounted], known=profile)
            learned.append(place)
        except ArmloadError as error:
            left_out.append(place | {"reason": str(error)})
        if first and k + 1 == min(FIRST, len(chosen)):
            profile, apart = _of_those_that_agree(arm, first, mounted)
            left_out += [learned[i] | {"reason": reason} for i, reason in apart.items()]
            learned = [place for i, place in enumerate(learned) if i not in apart]
        elif k + 1 == FIRST:
            return None, learned, left_out
    return profile, learned, left_out


def _of_those_that_agree(
    arm: Arm, logs: Sequence[Recording], mounted: NDArray[np.float64] | None
) -> tuple[Profile, dict[int, str]]:
    """The profile of those with the same mounted, and why the others were left out, by their numbers."""
    kept, apart = list(range(len(logs))), dict[int, str]()
    while True:
        some = [logs[i] for i in kept]
        try:
            return learn_profile(arm, some, [mounted] * len(some), sessions=by_clock(some)), apart
        except DisagreementError as error:
            apart[kept.pop(error.log)] = str(error)


def _stretch(row: dict[str, Any], settings: Settings) -> Recording:
    one = Log(row["log"], row["arm"], row["episode"])
    with on_this_machine(one) as path:
        log = settings.recording(one, path, row["episode"])
    return log.between(log.t[0] + row["t0"], log.t[0] + row["t1"])
