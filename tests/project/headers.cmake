# Every public header compiles alone, and twice. One source per header is generated when CMake runs.

# header_source(OUT HEADER FOLDER): writes the source that tests include/prolate/HEADER, and returns its path.
function(header_source out header folder)
  set(source ${folder}/${header}.cpp)
  file(CONFIGURE OUTPUT ${source} @ONLY CONTENT
    "#include <prolate/@header@>\n#include <prolate/@header@> // twice: the guard works\n")
  set(${out} ${source} PARENT_SCOPE)
endfunction()
