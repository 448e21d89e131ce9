# cmake -D SCRIPTS=<list> -D SOURCE=<folder> -D OUTPUT=<page> -P bundle.cmake
#
# One page of index.html, viewer.css and the modules. Browsers load no modules beside a page that was opened as a file,
# so their texts are joined into one: lines that import go, the word "export" goes, and each module follows those that
# it imports. All modules then share one scope; a name that two of them declare is an error when the page loads, which
# the test of the page finds.
cmake_minimum_required(VERSION 3.25)

set(script "")
foreach(name IN LISTS SCRIPTS)
  file(READ "${SOURCE}/${name}" text)
  string(REGEX REPLACE "\nimport [^\n]*" "" text "\n${text}")
  string(REGEX REPLACE "\nexport ((async )?function|class|const|let)" "\n\\1" text "${text}")
  string(APPEND script "\n// ---- ${name} ----${text}")
endforeach()
file(READ "${SOURCE}/index.html" page)
file(READ "${SOURCE}/viewer.css" style)
string(REPLACE "@STYLE@\n" "${style}" page "${page}")
string(REPLACE "@SCRIPT@\n" "${script}" page "${page}")
file(WRITE "${OUTPUT}" "${page}")
