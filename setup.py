"""What pyproject.toml cannot say: sdist and wheel of the same files are the same to the byte,
wherever they are built.

No time, owner or mode of the building machine goes in; SOURCE_DATE_EPOCH, where it is set, is the
time of all files.
"""

import gzip
import os
import tarfile
from pathlib import Path

from setuptools import setup
from setuptools.command.bdist_wheel import bdist_wheel
from setuptools.command.sdist import sdist

# 2020; zip files know no time before 1980
EPOCH = int(os.environ.setdefault("SOURCE_DATE_EPOCH", "1577836800"))


def anonymous(member: tarfile.TarInfo) -> tarfile.TarInfo:
    """A file of an archive without the one who built it."""
    member.mtime, member.uid, member.gid, member.uname, member.gname = EPOCH, 0, 0, "", ""
    member.mode = 0o755 if member.isdir() or member.mode & 0o100 else 0o644
    return member


class Reproducible(sdist):
    """`sdist` whose archive holds what is in the files and their names, and nothing else."""

    def make_archive(self, base_name, format, root_dir=None, base_dir=None, owner=None, group=None):
        path = Path(f"{base_name}.tar.gz")
        with (
            path.open("wb") as file,
            gzip.GzipFile("", "wb", mtime=EPOCH, fileobj=file) as packed,
            tarfile.open(fileobj=packed, mode="w", format=tarfile.PAX_FORMAT) as archive,
        ):
            archive.add(base_dir, filter=anonymous)  # in the order of names
        return str(path)


class Plain(bdist_wheel):
    """`bdist_wheel` whose files have the modes of new ones, not those that they have here."""

    def write_wheelfile(self, wheelfile_base, *generator):
        super().write_wheelfile(wheelfile_base, *generator)  # the last file but the list of all
        for path in Path(self.bdist_dir).rglob("*"):
            path.chmod(0o755 if path.is_dir() else 0o644)


setup(cmdclass={"sdist": Reproducible, "bdist_wheel": Plain})
