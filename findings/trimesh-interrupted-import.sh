#!/usr/bin/env bash
# trimesh 5.2.0 takes a Ctrl-C, while it is imported, for a library that is not installed; the interrupt comes up later.
#
# A good guess: KeyboardInterrupt during an import ends the program, as it does with any other package.
# What it does: optional imports stand in "except BaseException", which is also what Ctrl-C and sys.exit() raise. The
# import goes on, and the name stands for an object that raises the stored exception when it is used: so a program that
# was told to stop goes on, and is interrupted minutes later, in the first function that wants the library. Importing
# trimesh takes about a second, so a Ctrl-C at the start of a program is likely to meet it.
#
# Seen (SIGINT as trimesh asks for scipy.spatial, which is installed; then a function that uses it):
#     import, interrupted: goes on
#     clusters():          KeyboardInterrupt
#     clusters(), again:   KeyboardInterrupt
set -euo pipefail
cd "$(mktemp -d)" && trap 'rm -rf "$PWD"' EXIT
python3 -m venv python && python/bin/python -m pip install --quiet trimesh==5.2.0 scipy==1.17.1 numpy==2.3.5 networkx==3.6.1
cat >check.py <<'PYTHON'
import os, signal, sys


class Interrupter:
    def find_spec(self, name, path=None, target=None):
        if name == "scipy.spatial" and self in sys.meta_path:
            sys.meta_path.remove(self)
            os.kill(os.getpid(), signal.SIGINT)


sys.meta_path.insert(0, Interrupter())
try:
    import trimesh

    seen = ["goes on"]
except KeyboardInterrupt:
    seen = ["stops"]
    import trimesh
print("import, interrupted:", seen[0])
for call in ("clusters():         ", "clusters(), again:  "):
    try:
        trimesh.grouping.clusters([[0, 0, 0], [1e-9, 0, 0]], 1e-6)
        seen.append("works")
    except KeyboardInterrupt:
        seen.append("KeyboardInterrupt")
    print(call, seen[-1])
raise SystemExit(0 if seen == ["goes on", "KeyboardInterrupt", "KeyboardInterrupt"] else 1)
PYTHON
python/bin/python check.py
