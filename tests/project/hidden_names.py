#!/usr/bin/env python3
"""Finds names local to a .cpp that hide a name of a header.

usage: hidden_names.py ROOT

CI compiles many files of a folder as one unit. There a constant, function or type in the unnamed namespace of one file
is seen by the next one, too, and takes the place of a header's name of an enclosing namespace: the next file computes
with another number, and nothing warns. So a local name must differ from all that the headers of its library, of src/
and of include/prolate declare in its namespace or those around it. Functions may overload those of their own namespace.

Reads as much of C++ as it takes to know what namespaces declare; it does not expand macros.
"""

import re
import sys
from pathlib import Path

LIBRARIES = ("src", "query", "builder", "cli", "capi")
EVERYWHERE = ("include/prolate", "src")

BLANKED = re.compile(
    r'//[^\n]*|/\*.*?\*/|R"(\w*)\(.*?\)\1"|"(?:[^"\\\n]|\\.)*"|(?<![0-9a-fA-F])\'(?:[^\'\\\n]|\\.)+\''
    r"|^[ \t]*#(?:[^\n\\]|\\.)*",
    re.DOTALL | re.MULTILINE,
)
MARKS = re.compile(r"[(){};]")
NAMESPACE = re.compile(r"(?:inline\s+)?namespace\b\s*([\w:]*)\s*$")
LANGUAGE = re.compile(r"extern\s*$")  # "C", which is blanked
TYPE = re.compile(
    r"(?:template\b.*>\s*)?(?:class|struct|union|enum(?:\s+class|\s+struct)?)\s+(\w+)(?=\s*(?:$|:|final\b))", re.DOTALL
)
ALIAS = re.compile(r"(?:template\b.*>\s*)?using\s+(\w+)\s*=", re.DOTALL)
NO_DECLARATION = re.compile(r"\s*(?:using|static_assert|friend|typedef|asm|extern\s+template)\b")
CALL = re.compile(r"(?<![\w:~])(?!(?:alignas|decltype|requires|noexcept|__attribute__)\b)([A-Za-z_]\w*)\s*\(")
VARIABLE = re.compile(r"[\w>&*\]]\s+[&*]?([A-Za-z_]\w*)\s*(?:\[[^\]]*\]\s*)*(?:=|\{|$)|[&*]([A-Za-z_]\w*)\s*(?:=|\{|$)")
FURTHER = re.compile(r",\s*([A-Za-z_]\w*)\s*(?:\[[^\]]*\]\s*)*(?==)")


def declared(head):
    """What a statement of a namespace declares: [(name, is it a function?)]."""
    head = re.sub(r"\[\[.*?\]\]", "", head, flags=re.DOTALL).strip()
    if found := ALIAS.match(head):
        return [(found[1], False)]
    if not head or NO_DECLARATION.match(head):
        return []
    if head.startswith(","):  # behind a variable's braces
        return [(name, False) for name in FURTHER.findall(head)]
    if found := TYPE.match(head):
        return [(found[1], False)]
    call, equals = CALL.search(head), head.find("=")
    if call and not 0 <= equals < call.start():
        return [(call[1], True)] if call.start() > 0 else []  # else a constructor, or a macro
    found = VARIABLE.search(head)
    if not found or "::" in found[0]:
        return []
    return [(found[1] or found[2], False)] + [(name, False) for name in FURTHER.findall(head, found.end())]


def declarations(text):
    """Of a file: (name, namespace, is it a function?, local to the file?, line). Blocks of code are passed over."""
    text = BLANKED.sub(lambda found: re.sub(r"[^\n]", " ", found[0]), text)
    spaces, start, inside, code = [], 0, 0, 0  # inside: of parentheses; code: of braces
    for mark in MARKS.finditer(text):
        sign = mark[0]
        if sign in "()":
            inside += 0 if code else 1 if sign == "(" else -1
        elif sign == "{" and (code or inside):
            code += 1
        elif sign == "}" and code:
            code -= 1
        elif not inside and not code:
            head = text[start : mark.start()]
            if sign == "{" and (found := NAMESPACE.search(head)):
                spaces.append(found[1])
            elif sign == "{" and LANGUAGE.search(head):
                spaces.append("extern")
            elif sign == "}":
                if spaces:
                    spaces.pop()
            else:
                path = tuple(part for space in spaces for part in space.split("::") if part and part != "extern")
                local = "" in spaces or re.match(r"\s*static\b", head) is not None
                for name, function in declared(head):
                    yield name, path, function, local, text.count("\n", 0, mark.start()) + 1
                code = sign == "{"
            start = mark.end()
        if sign == "}" and not code:
            start = mark.end() if not inside else start


def main(root):
    def names_of(folder):  # {name: {(namespace, is it a function?): header}}
        names = {}
        for header in sorted((root / folder).rglob("*.hpp")):
            for name, path, function, local, _ in declarations(header.read_text(encoding="utf-8")):
                if not local:
                    names.setdefault(name, {}).setdefault((path, function), header.relative_to(root))
        return names

    known, count, bad = {folder: names_of(folder) for folder in {*EVERYWHERE, *LIBRARIES}}, 0, 0
    for library in LIBRARIES:
        for source in sorted((root / library).rglob("*.cpp")):
            for name, path, function, local, line in declarations(source.read_text(encoding="utf-8")):
                count += 1
                others = [
                    (other, is_function, header)
                    for folder in dict.fromkeys((library, *EVERYWHERE))
                    for (other, is_function), header in known[folder].get(name, {}).items()
                    if local and path[: len(other)] == other
                ]
                overload = function and any(is_function and other == path for other, is_function, _ in others)
                if others and not overload:
                    bad += 1
                    print(
                        f"{source.relative_to(root)}:{line}: {name} hides that of {others[0][2]}; give it another name"
                    )
    if count == 0:
        sys.exit("no declarations found")
    sys.exit(1 if bad else 0)


if __name__ == "__main__":
    main(Path(sys.argv[1]))
