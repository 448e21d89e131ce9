# cmake --install, and the package that find_package(prolate [COMPONENTS query builder]) reads.
include(CMakePackageConfigHelpers)

install(TARGETS prolate_core prolate_query EXPORT prolate-query-targets
  ARCHIVE DESTINATION ${CMAKE_INSTALL_LIBDIR})
if(PROLATE_BUILD_C)
  install(TARGETS prolate_c EXPORT prolate-query-targets
    LIBRARY DESTINATION ${CMAKE_INSTALL_LIBDIR} ARCHIVE DESTINATION ${CMAKE_INSTALL_LIBDIR})
endif()
install(EXPORT prolate-query-targets NAMESPACE prolate::
  DESTINATION ${CMAKE_INSTALL_LIBDIR}/cmake/prolate)

if(PROLATE_BUILD_BUILDER)
  install(TARGETS prolate_builder EXPORT prolate-builder-targets
    ARCHIVE DESTINATION ${CMAKE_INSTALL_LIBDIR})
  install(EXPORT prolate-builder-targets NAMESPACE prolate::
    DESTINATION ${CMAKE_INSTALL_LIBDIR}/cmake/prolate)
endif()
if(PROLATE_BUILD_CLI)
  install(TARGETS prolate_cli RUNTIME DESTINATION ${CMAKE_INSTALL_BINDIR})
  install(FILES ${PROJECT_BINARY_DIR}/self/prolate.1 DESTINATION ${CMAKE_INSTALL_MANDIR}/man1)
  install(FILES ${PROJECT_BINARY_DIR}/self/bash RENAME prolate DESTINATION ${CMAKE_INSTALL_DATADIR}/bash-completion/completions)
  install(FILES ${PROJECT_BINARY_DIR}/self/zsh RENAME _prolate DESTINATION ${CMAKE_INSTALL_DATADIR}/zsh/site-functions)
  install(FILES ${PROJECT_BINARY_DIR}/self/fish RENAME prolate.fish DESTINATION ${CMAKE_INSTALL_DATADIR}/fish/vendor_completions.d)
endif()

# All headers, but for the builder's where it is not built. eigen.hpp and tbb.hpp are for programs that have these.
set(excluded_headers "")
if(NOT PROLATE_BUILD_BUILDER)
  set(excluded_headers REGEX "/(build|mesh|modes|rig|verify)\\.hpp$" EXCLUDE)
endif()
install(DIRECTORY ${PROJECT_SOURCE_DIR}/include/prolate DESTINATION ${CMAKE_INSTALL_INCLUDEDIR}
  FILES_MATCHING PATTERN "*.hpp" PATTERN "*.h" ${excluded_headers})

configure_package_config_file(${PROJECT_SOURCE_DIR}/cmake/prolate-config.cmake.in
  ${PROJECT_BINARY_DIR}/prolate-config.cmake INSTALL_DESTINATION ${CMAKE_INSTALL_LIBDIR}/cmake/prolate)
write_basic_package_version_file(${PROJECT_BINARY_DIR}/prolate-config-version.cmake
  COMPATIBILITY SameMinorVersion)
install(FILES ${PROJECT_BINARY_DIR}/prolate-config.cmake ${PROJECT_BINARY_DIR}/prolate-config-version.cmake
  DESTINATION ${CMAKE_INSTALL_LIBDIR}/cmake/prolate)
install(FILES ${PROJECT_SOURCE_DIR}/LICENSE-APACHE ${PROJECT_SOURCE_DIR}/LICENSE-MIT ${PROJECT_SOURCE_DIR}/LICENSE
  DESTINATION ${CMAKE_INSTALL_DOCDIR})
