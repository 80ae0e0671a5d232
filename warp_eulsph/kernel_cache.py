"""How the package's kernels are compiled, and built anew where they were damaged in Warp's cache.

Each kernel is a module, and each reads Warp's header in the compiler's own form. More than half of what that took went
into templates of the header, instantiated again in every module; now they are instantiated once, with the header. The
machine code is the same in every byte.

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
# Clang's option for the above, https://reviews.llvm.org/D69585
ONCE = "-fpch-instantiate-templates"
# What Warp takes where ``wp.config.cpu_compiler_flags`` is None
WARPS_FLAGS = "-march=native"


def look_after_kernels() -> None:
    """From now on the package's kernels are compiled fast, and anew if they cannot be loaded; once is enough.

    Only files of the module that Warp failed to load are removed; when it fails again, that is the error. A file
    that can be loaded and has wrong bits is not seen.
    """
    load = wp.Module.load
    if not hasattr(load, "rebuilds"):
        wp.Module.load = _rebuilding(load)


def _rebuilding(load: Any) -> Any:
    @functools.wraps(load)
    def rebuilding(module: Any, device: wp.DeviceLike, block_dim: int | None = None, *more: Any, **options: Any) -> Any:
        _instantiate_once(module)
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


def _instantiate_once(module: Any) -> None:
    """Of a module of the package that has no flags of its own yet."""
    if module.name.startswith(OWN) and module.options["cpu_compiler_flags"] is None:
        given = wp.config.cpu_compiler_flags
        flags = f"{WARPS_FLAGS if given is None else given} {ONCE}"
        wp.set_module_options({"cpu_compiler_flags": flags}, module)


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
