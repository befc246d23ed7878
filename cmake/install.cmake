# cmake --install, find_package(supertac) and pkg-config, right in any prefix.
include(CMakePackageConfigHelpers)
get_property(libraries GLOBAL PROPERTY SUPERTAC_LIBRARIES)
install(TARGETS ${libraries} EXPORT supertac ARCHIVE DESTINATION ${CMAKE_INSTALL_LIBDIR} COMPONENT development)
# The C library: programs need the file with the soname, who compiles them the link and the header.
install(TARGETS supertac_c EXPORT supertac LIBRARY DESTINATION ${CMAKE_INSTALL_LIBDIR} COMPONENT programs
  NAMELINK_COMPONENT development)
if(SKBUILD)  # python/pyproject.toml: the wheel of the Python package
  install(PROGRAMS $<TARGET_FILE:supertac_c> DESTINATION supertac RENAME libsupertac.so COMPONENT python)
endif()
install(FILES library/supertac.h DESTINATION ${CMAKE_INSTALL_INCLUDEDIR}/supertac COMPONENT development)
install(CODE "set(SUPERTAC_SOURCE [[${PROJECT_SOURCE_DIR}]])
set(SUPERTAC_BUILD [[${PROJECT_BINARY_DIR}]])
set(SUPERTAC_INCLUDEDIR [[${CMAKE_INSTALL_INCLUDEDIR}]])" COMPONENT development)
install(SCRIPT cmake/install_headers.cmake COMPONENT development)
install(EXPORT supertac NAMESPACE supertac:: DESTINATION ${CMAKE_INSTALL_LIBDIR}/cmake/supertac
  FILE supertacTargets.cmake COMPONENT development)
file(WRITE ${PROJECT_BINARY_DIR}/supertacConfig.cmake
"include(CMakeFindDependencyMacro)\nfind_dependency(OpenMP COMPONENTS CXX)\nfind_dependency(Threads)\nfind_dependency(nlohmann_json)\nfind_dependency(ZLIB)
include(\${CMAKE_CURRENT_LIST_DIR}/supertacTargets.cmake)\n")
write_basic_package_version_file(${PROJECT_BINARY_DIR}/supertacConfigVersion.cmake COMPATIBILITY SameMinorVersion)
install(FILES ${PROJECT_BINARY_DIR}/supertacConfig.cmake ${PROJECT_BINARY_DIR}/supertacConfigVersion.cmake
  DESTINATION ${CMAKE_INSTALL_LIBDIR}/cmake/supertac COMPONENT development)

# For pkg-config: `supertac` is the C library, `supertac-cpp` the static ones, which need each other in turn. What these
# need of others is named only where it is called: --as-needed leaves the rest out.
foreach(library ${libraries})
  get_target_property(type ${library} TYPE)
  if(type STREQUAL "STATIC_LIBRARY")
    string(APPEND links " -l${library}")
  endif()
endforeach()
# A relative folder is found from where the .pc file lies, wherever the prefix was moved; an absolute one stays.
file(RELATIVE_PATH to_prefix /${CMAKE_INSTALL_LIBDIR}/pkgconfig /)
set(prefix "\${pcfiledir}/${to_prefix}")
set(libdir "\${prefix}/${CMAKE_INSTALL_LIBDIR}")
set(includedir "\${prefix}/${CMAKE_INSTALL_INCLUDEDIR}")
if(IS_ABSOLUTE "${CMAKE_INSTALL_LIBDIR}")
  set(prefix "${CMAKE_INSTALL_PREFIX}")
  set(libdir "${CMAKE_INSTALL_LIBDIR}")
endif()
if(IS_ABSOLUTE "${CMAKE_INSTALL_INCLUDEDIR}")
  set(includedir "${CMAKE_INSTALL_INCLUDEDIR}")
endif()
set(head "prefix=${prefix}\nlibdir=${libdir}\nincludedir=${includedir}
Version: ${PROJECT_VERSION}\n")
file(WRITE ${PROJECT_BINARY_DIR}/supertac.pc "${head}Name: supertac
Description: ${PROJECT_DESCRIPTION}: the C library
Cflags: -I\${includedir}
Libs: -L\${libdir} -lsupertac\n")
file(WRITE ${PROJECT_BINARY_DIR}/supertac-cpp.pc "${head}Name: supertac-cpp
Description: ${PROJECT_DESCRIPTION}: the C++ libraries
Cflags: -I\${includedir} ${SUPERTAC_SAME_BITS}
Libs: -L\${libdir} -Wl,--as-needed -Wl,--start-group${links} -Wl,--end-group -lkissfft-float -lz -fopenmp -pthread\n")
install(FILES ${PROJECT_BINARY_DIR}/supertac.pc ${PROJECT_BINARY_DIR}/supertac-cpp.pc
  DESTINATION ${CMAKE_INSTALL_LIBDIR}/pkgconfig COMPONENT development)
