"""Compiled kernels that were damaged in Warp's cache: built anew.

Warp keeps each module of kernels in a folder of its cache and believes what lies there. A file that a full disk or a
power failure cut short can then not be loaded, in every later run. Nothing is lost by building it again.
"""

import functools
import logging
from pathlib import Path
from typing import Any

import warp as wp

log = logging.getLogger(__name__)

# Modules of the package's kernels, which are made in functions of these names; see ``notices``.
OWN = ("_make_", "make_")
# What Warp compiles and reads again, beside its source.
_COMPILED = (".o", ".meta", ".cubin", ".ptx")


def rebuild_damaged() -> None:
    """From now on the package's kernels that cannot be loaded from Warp's cache are compiled anew; once is enough.

    Only files of the module that Warp failed to load are removed; when it fails again, that is the error. A file
    that can be loaded and has wrong bits is not seen.
    """
    load = wp.Module.load
    if not hasattr(load, "rebuilds"):
        wp.Module.load = _rebuilding(load)


def _rebuilding(load: Any) -> Any:
    @functools.wraps(load)
    def rebuilding(module: Any, device: wp.DeviceLike, block_dim: int | None = None, *more: Any, **options: Any) -> Any:
        try:
            return load(module, device, block_dim, *more, **options)
        except Exception as error:  # of no kind of its own
            kept = _compiled(module, block_dim)
            if not kept:
                raise
            log.warning("a compiled kernel in %s cannot be loaded (%s); building it anew", kept[0].parent, error)
            _remove(kept)
        return load(module, device, block_dim, *more, **options)

    rebuilding.rebuilds = True  # type: ignore[attr-defined]
    return rebuilding


def _compiled(module: Any, block_dim: int | None) -> list[Path]:
    """What the cache has of a module of the package; nothing of others."""
    if not module.name.startswith(OWN) or wp.config.kernel_cache_dir is None:
        return []
    folder = Path(wp.config.kernel_cache_dir) / module.get_module_identifier(block_dim)
    return [path for path in folder.glob("*") if path.suffix in _COMPILED]


def _remove(paths: list[Path]) -> None:
    for path in paths:
        try:
            path.unlink(missing_ok=True)
        except OSError as error:
            raise OSError(
                f"the compiled kernel {path} is damaged and cannot be removed ({error}); remove it, or let Warp keep "
                "its kernels elsewhere: WARP_CACHE_PATH=FOLDER"
            ) from None
