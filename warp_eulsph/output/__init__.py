"""What a run leaves on disk; the only room that knows HDF5."""

from .series import SnapshotWriter
from .snapshot import FIELDS, Snapshot, read_snapshot, write_snapshot

__all__ = ["FIELDS", "Snapshot", "SnapshotWriter", "read_snapshot", "write_snapshot"]
