"""What a run leaves on disk and says about itself; the only room that knows HDF5."""

from .report import Figure, table
from .series import SnapshotWriter
from .snapshot import FIELDS, Snapshot, read_snapshot, write_snapshot

__all__ = ["FIELDS", "Figure", "Snapshot", "SnapshotWriter", "read_snapshot", "table", "write_snapshot"]
