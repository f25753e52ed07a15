"""`armload live --learn`: what a stream has shown of the empty arm becomes a session of a profile's file."""

from __future__ import annotations

import os
import time
from typing import TYPE_CHECKING

from armload.app.cli.outputs import ChangedError, contents_of, replacing_unchanged
from armload.app.cli.printing import print_note
from armload.errors import IdentificationError, ModelError

if TYPE_CHECKING:
    from armload.service import Session


def learn_from(session: Session, path: str) -> None:
    """Add what a stream that has ended showed of the empty arm to a profile's file, and say what became of it.

    What other programs add to the file meanwhile is kept: it is learned once more, beside what the file holds then.

    Raises:
        ModelError: the file cannot be written. UsageError: another program is writing it and does not end.
    """
    from armload.posterior import load_profile, save_profile

    name = session.source.name
    if not os.path.exists(name):  # else of a log, which has a name of its own
        name = f"{name} {time.strftime('%Y-%m-%d %H:%M UTC', time.gmtime())}"
    while True:
        before = contents_of(path)
        try:
            now = load_profile(path) if os.path.exists(path) else None
            profile = session.identifier.learned(name, now)
        except (IdentificationError, ModelError) as error:
            print_note(f"{path} is as it was: {error}")
            return
        if profile is None:
            print_note(f"{path} is as it was: the stream showed no 20 s of the empty arm as the profile knows it")
            return
        try:
            with replacing_unchanged("--profile", path, before):
                save_profile(profile, path)
            break
        except ChangedError:  # another program has added to it meanwhile: so does this one, to what it is now
            continue
    print_note(f"{path}: learned {profile.sessions[-1].duration:.0f} s of the empty arm")
