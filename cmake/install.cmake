# cmake --install and find_package(supertac)
include(CMakePackageConfigHelpers)
get_property(libraries GLOBAL PROPERTY SUPERTAC_LIBRARIES)
install(TARGETS ${libraries} EXPORT supertac ARCHIVE DESTINATION ${CMAKE_INSTALL_LIBDIR} COMPONENT development)
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

# The same for pkg-config; static libraries need each other in turn.
foreach(library ${libraries})
  get_target_property(type ${library} TYPE)
  if(type STREQUAL "STATIC_LIBRARY")
    string(APPEND links " -l${library}")
  endif()
endforeach()
file(CONFIGURE OUTPUT ${PROJECT_BINARY_DIR}/supertac.pc @ONLY CONTENT
"prefix=@CMAKE_INSTALL_PREFIX@
Name: supertac
Description: @PROJECT_DESCRIPTION@
Version: @PROJECT_VERSION@
Cflags: -I\${prefix}/@CMAKE_INSTALL_INCLUDEDIR@
Libs: -L\${prefix}/@CMAKE_INSTALL_LIBDIR@ -Wl,--start-group@links@ -Wl,--end-group -lz -fopenmp -pthread
")
install(FILES ${PROJECT_BINARY_DIR}/supertac.pc DESTINATION ${CMAKE_INSTALL_LIBDIR}/pkgconfig COMPONENT development)
