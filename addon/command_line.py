# SPDX-License-Identifier: GPL-3.0-or-later
"""`blender --background FILE.blend --command spectral_match match|transfer|batch …`

Exit status: 0 done, 1 something failed, 2 wrong usage, 130 cancelled. Progress and reasons go to standard
error, a line each.
"""

from __future__ import annotations

import argparse
import json
import os
import secrets
import signal
import sys
from functools import partial
from pathlib import Path
from typing import Any

import bpy

from . import batch, core
from .transfer import KINDS

DONE, FAILED, WRONG_USAGE, CANCELLED = 0, 1, 2, 130
# How a report begins, by which an earlier one is known.
REPORT_BEGINNING = b'{\n "blender": '
_command = None


def run(arguments: list[str]) -> int:
    """Do one step on the opened file, or on the files of a manifest; returns the exit status."""
    try:
        wishes = _wishes(arguments)
    except SystemExit as end:
        return end.code if isinstance(end.code, int) else WRONG_USAGE
    if wishes.json and not wishes.overwrite and _is_anothers(Path(wishes.json)):
        return _fail(f"{wishes.json} is there already and is no report: give another --json, or --overwrite")
    report = {"blender": bpy.app.version_string, "step": wishes.step, "files": []}
    previous = signal.getsignal(signal.SIGINT)
    # Without a window Blender keeps Ctrl-C to itself.
    signal.signal(signal.SIGINT, signal.default_int_handler)
    try:
        status = _work(wishes, report)
    except (batch.WrongRequestError, core.CoreMissingError) as reason:
        report["reason"] = str(reason)
        status = _fail(str(reason))
    except (batch.CancelledError, KeyboardInterrupt):
        report["reason"] = "cancelled"
        _tell("cancelled; files not yet saved are as they were")
        status = CANCELLED
    finally:
        if previous is not None:
            signal.signal(signal.SIGINT, previous)
    report["status"] = status
    if wishes.json:
        try:
            _write_whole(
                Path(wishes.json).absolute(), json.dumps(report, indent=1, ensure_ascii=False) + "\n"
            )
        except OSError as reason:
            return _fail(f"the report cannot be written: {reason}")
    return status


def _wishes(arguments: list[str]) -> argparse.Namespace:
    """Parsed arguments that fit together; else argparse's own exit with words and status 2."""
    parser = _parser()
    wishes = parser.parse_args(arguments)

    def given(*names: str) -> str:
        return ", ".join("--" + name.replace("_", "-") for name in names if getattr(wishes, name))

    described = given("source", "source_file", "target", "transfer", "output", "keep_source")
    if wishes.manifest and described:
        parser.error(f"with --manifest leave out {described}: it says so itself")
    if not wishes.manifest and (of_manifest := given("folder", "anywhere")):
        parser.error(f"{of_manifest} needs --manifest; without it --output says where to save")
    if not wishes.manifest and not (wishes.source and wishes.target):
        parser.error("give --source and --target, or --manifest")
    return wishes


def _kinds(words: str) -> frozenset[str]:
    try:
        return batch.kinds_of(words.split(","))
    except batch.WrongRequestError as reason:
        raise argparse.ArgumentTypeError(str(reason)) from None


def _parser() -> argparse.ArgumentParser:
    kinds = ",".join(kind.identifier for kind in KINDS)
    parser = argparse.ArgumentParser(
        prog="blender --background FILE.blend --command spectral_match",
        description="Match meshes and carry data from one to others, in the opened file or in the files of "
        "a manifest. The step 'batch' is match, then transfer.",
        epilog="Exit status: 0 done, 1 something failed, 2 wrong usage, 130 cancelled.",
    )
    parser.add_argument("step", choices=("match", "transfer", "batch"))
    objects = parser.add_argument_group("objects of the opened file")
    objects.add_argument(
        "--source",
        metavar="NAME",
        help="mesh that has the data, or armature, empty or collection: all meshes of it",
    )
    objects.add_argument("--source-file", metavar="FILE.blend", help="where that object is, if not here")
    objects.add_argument(
        "--target", metavar="NAME[,NAME…]", help="what receives it, likewise; * and ? stand for any letters"
    )
    objects.add_argument("--output", metavar="OUT.blend", help="where to save")
    files = parser.add_argument_group("many files")
    files.add_argument("--manifest", metavar="MANIFEST.toml", help="files, objects and outputs, instead")
    files.add_argument("--folder", metavar="DIR", help="where its outputs go, instead of what it says")
    files.add_argument("--anywhere", action="store_true", help="let it save outside of its folder")
    both = parser.add_argument_group("both")
    both.add_argument(
        "--transfer",
        type=_kinds,
        metavar="KIND[,KIND…]",
        help=f"what to carry, by default {kinds}; {batch.OUTFIT} fits what the source wears",
    )
    both.add_argument("--method", choices=("auto", "paper"))
    both.add_argument("--part", choices=("source", "target"), help="which is only a part of the other")
    both.add_argument("--mirror", choices=("forbid", "allow"), help="may left and right be exchanged")
    both.add_argument(
        "--same-axes", action="store_true", help="left, front and up are the same directions on both"
    )
    both.add_argument("--keep-source", action="store_true", help="save a source of another file, too")
    there = both.add_mutually_exclusive_group()
    there.add_argument(
        "--overwrite", action="store_true", help="replace outputs, and inputs of the same name"
    )
    there.add_argument("--resume", action="store_true", help="leave out files whose output is there")
    both.add_argument("--json", metavar="REPORT.json", help="what was done to each pair")
    return parser


def _work(wishes: argparse.Namespace, report: dict[str, Any]) -> int:
    jobs, options = _jobs(wishes)
    options |= {name: value for name in batch.OPTIONS if (value := getattr(wishes, name))}
    left = batch.check_overwriting(jobs, wishes.overwrite, wishes.resume)
    report["skipped"] = [str(job.output) for job in jobs if job not in left]
    request = batch.Request(wishes.step != "transfer", wishes.step != "match", options)
    failed = 0
    for number, job in enumerate(left, start=1):
        prefix = f"file {number} of {len(left)}, " if len(left) > 1 else ""
        request.tell = partial(_tell_of, prefix)
        entry = batch.work_on(bpy.context, job, request)
        report["files"].append(entry)
        failed_pairs = sum(pair["status"] != "done" for pair in entry["pairs"])
        failed += failed_pairs or entry["status"] != "done"
        if entry["status"] == "done":
            request.tell(f"saved {entry['output']}")
        else:
            request.tell(f"{entry['file']} failed: {entry['reason']}")
    return _fail(f"{failed} of the pairs or files failed") if failed else DONE


def _jobs(wishes: argparse.Namespace) -> tuple[list[batch.FileJob], dict[str, Any]]:
    """The jobs of the manifest, or the one that the options describe, and the manifest's options."""
    if wishes.manifest:
        return batch.read_manifest(wishes.manifest, wishes.folder, wishes.anywhere)
    output = wishes.output or (bpy.data.filepath if wishes.overwrite else "")
    if not output:
        raise batch.WrongRequestError("Nothing to save to: give --output, or --overwrite for the opened file")
    source_file = Path(wishes.source_file).absolute() if wishes.source_file else None
    if source_file and not source_file.is_file():
        raise batch.WrongRequestError(f"There is no file {source_file}")
    job = batch.FileJob(
        file=None,
        pairings=(batch.Pairing(wishes.source, tuple(wishes.target.split(","))),),
        output=Path(output).absolute(),
        kinds=wishes.transfer or batch.kinds_of(None),
        source_file=source_file,
        keep_source=wishes.keep_source,
    )
    return [job], {}


def _is_anothers(path: Path) -> bool:
    """Whether a file is there that is neither a report nor empty."""
    if not path.is_file():
        return False
    with open(path, "rb") as file:
        head = file.read(len(REPORT_BEGINNING))
    return not REPORT_BEGINNING.startswith(head)


def _write_whole(path: Path, text: str) -> None:
    path.parent.mkdir(parents=True, exist_ok=True)
    temporary = path.with_name(f".{path.name}.{secrets.token_hex(4)}")
    file = open(temporary, "x", encoding="utf-8")
    try:
        with file:
            file.write(text)
        os.replace(temporary, path)
    finally:
        temporary.unlink(missing_ok=True)


def _tell(words: str) -> None:
    # Names of objects and files may hold anything, also what moves a terminal's cursor.
    line = " ".join(words.split())
    shown = "".join(letter if letter.isprintable() else f"\\x{ord(letter):02x}" for letter in line)
    sys.stderr.write(f"spectral_match: {shown}\n")
    sys.stderr.flush()


def _tell_of(prefix: str, words: str) -> None:
    _tell(prefix + words)


def _fail(words: str) -> int:
    _tell(words)
    return FAILED


def register() -> None:
    global _command
    _command = bpy.utils.register_cli_command("spectral_match", run)


def unregister() -> None:
    bpy.utils.unregister_cli_command(_command)
