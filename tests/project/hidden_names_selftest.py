#!/usr/bin/env python3
"""usage: hidden_names_selftest.py ROOT

Plants local names in a small library, and demands that hidden_names.py finds those that hide a header's, and no other;
in ROOT itself it must see the declarations that are known to be there.
"""

import contextlib
import io
import sys
import tempfile
from pathlib import Path

import hidden_names

HEADER = """
#pragma once
namespace prolate {
inline constexpr uint16_t kFlag = 1, kMostSteps = 0x7fff; // kCommented
struct Piece { int kMember = 0; void inside(int kParameter = {}); };
class Forward;
template <class T> T twice(const T& x) { const int kLocal = 2; return kLocal * x; }
[[nodiscard]] double length(const Piece& piece = {}) noexcept;
namespace query { bool meets(int a); double length(int x); }
}
"""
HIDES = {  # what stands in a .cpp: the name that is found
    "namespace prolate { namespace { constexpr int kMostSteps = 3; } }": "kMostSteps",
    "namespace prolate { namespace {\\nconstexpr int kOther = 60; // steps\\nconstexpr int kFlag{3};\\n} }": "kFlag",
    "namespace prolate::query { static const double kFlag = f(2); }": "kFlag",
    "namespace prolate { namespace { struct Piece { int x; }; } }": "Piece",
    "namespace prolate { namespace { enum class Forward : int { a }; } }": "Forward",
    "namespace prolate { namespace query { namespace { using Piece = int; } } }": "Piece",
    "namespace prolate::query { namespace { int twice(int x) { return 2 * x; } } }": "twice",
    "namespace prolate { namespace { const Piece kTable[] = {{1}, {2}}, kFlag[3] = {}; } }": "kFlag",
}
HIDES_NOTHING = (
    "namespace prolate { namespace { constexpr int kCommented = 1, kMember = 2, kParameter = 3, kLocal = 4; } }",
    "namespace prolate { void f() { constexpr int kMostSteps = 3; struct Piece {}; } }",
    "namespace prolate { namespace { void f(int kFlag = {}) { if (kFlag) { int twice = 0; } } } }",
    "namespace prolate { namespace { double length(float x) { return x; } } }",  # an overload
    "namespace prolate::query { namespace { double length(float x) { return x; } } }",  # of query's own
    "namespace prolate { namespace { bool meets(int a) { return a; } } }",  # the header's lies deeper
    "namespace prolate { double length(const Piece& piece) noexcept { return 0; } }",  # its definition
    "namespace other { namespace { constexpr int kFlag = 3; struct Piece {}; } }",
    "namespace prolate { namespace { const char* kText = \"struct Piece {\"; char kBrace = '{'; } }",
)


def found(text):
    """What the check prints of a library with this source, and whether it passes."""
    with tempfile.TemporaryDirectory() as folder:
        root = Path(folder)
        for library in (*hidden_names.LIBRARIES, "include/prolate"):
            (root / library).mkdir(parents=True)
        (root / "src/header.hpp").write_text(HEADER)
        (root / "query/planted.cpp").write_text(text)
        printed = io.StringIO()
        with contextlib.redirect_stdout(printed):
            try:
                hidden_names.main(root)
            except SystemExit as end:
                return printed.getvalue(), end.code
    raise AssertionError("it says nothing")


def main(root):
    for text, name in HIDES.items():
        text = text.replace("\\n", "\n")
        printed, code = found(text)
        line = next(i for i, one in enumerate(text.split("\n"), 1) if name in one)
        assert code == 1, f"{text}: passes"
        assert printed.startswith(f"query/planted.cpp:{line}: {name} hides that of src/header.hpp"), (
            f"{text}: {printed}"
        )
    for text in HIDES_NOTHING:
        printed, code = found(text)
        assert code == 0, f"{text}: {printed}"
    assert found("")[1] == "no declarations found"
    seen = {
        name
        for file in ("src/deformation.hpp", "src/layout.hpp", "query/node/best_first.hpp")
        for name, *_ in hidden_names.declarations((root / file).read_text(encoding="utf-8"))
    }
    assert seen >= {"kIsRadius", "kMostMotionSteps", "kMostMotionGrowth", "kMagic", "kOpenB", "kLeaves"}, seen


if __name__ == "__main__":
    main(Path(sys.argv[1]))
