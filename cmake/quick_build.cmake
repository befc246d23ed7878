# -DSUPERTAC_QUICK_BUILD=ON, as scripts/demo.sh and scripts/test.sh have it: headers of the standard library, JSON and
# GoogleTest are parsed once for all files, and up to eight files of a library or a program are compiled as one. Off by
# default, since a file that forgets an #include would compile with it, and whoever changes one file compiles eight.
if(NOT SUPERTAC_QUICK_BUILD)
  return()
endif()

find_package(nlohmann_json REQUIRED)
if(SUPERTAC_TESTS)
  find_package(GTest REQUIRED)
endif()
set(standard <algorithm> <filesystem> <functional> <memory> <optional> <span> <string> <vector>)
set(headers_plain ${standard})
set(headers_json ${standard} <nlohmann/json.hpp>)
set(headers_test ${PROJECT_SOURCE_DIR}/tests/support/test.h)
set(headers_test_json ${headers_test} <nlohmann/json.hpp>)
file(WRITE ${PROJECT_BINARY_DIR}/precompiled.cpp "int main() {}\n")
# Files for one instruction set have flags with which a header compiled without them is of no use, and names in common.
file(GLOB_RECURSE own_flags ${PROJECT_SOURCE_DIR}/autograd/kernels/fast/*.cpp)
set_source_files_properties(${own_flags} TARGET_DIRECTORY supertac_autograd supertac_autograd_f64
  PROPERTIES SKIP_PRECOMPILE_HEADERS ON)

# It has types of the anonymous namespace in a class of a header.
set_source_files_properties(${PROJECT_SOURCE_DIR}/models/inference/compiled/integer_plan.cpp TARGET_DIRECTORY supertac_compiled
  PROPERTIES SKIP_UNITY_BUILD_INCLUSION ON)

# A library (-fPIC) and a program (-fPIE) cannot share a header, nor can files with OpenMP and without, nor examples, which
# have none of our options.
function(supertac_precompile target)
  get_target_property(type ${target} TYPE)
  get_target_property(libraries ${target} LINK_LIBRARIES)
  if(NOT type MATCHES "STATIC_LIBRARY|EXECUTABLE" OR NOT libraries MATCHES "supertac_options")
    return()
  endif()
  get_target_property(folder ${target} SOURCE_DIR)
  set(kind plain)
  if(libraries MATCHES "GTest" AND folder MATCHES "/(apps|failures|models)")
    set(kind test_json)
  elseif(libraries MATCHES "GTest")
    set(kind test)
  elseif(folder MATCHES "/(apps|io|models|windows)")
    set(kind json)
  endif()
  set(header precompiled_${kind}_${type})
  if(NOT TARGET ${header})
    if(type STREQUAL "EXECUTABLE")
      add_executable(${header} EXCLUDE_FROM_ALL ${PROJECT_BINARY_DIR}/precompiled.cpp)
    else()
      add_library(${header} STATIC EXCLUDE_FROM_ALL ${PROJECT_BINARY_DIR}/precompiled.cpp)
    endif()
    target_link_libraries(${header} PRIVATE supertac_options nlohmann_json::nlohmann_json)
    target_compile_options(${header} PRIVATE ${OpenMP_CXX_FLAGS})
    if(kind MATCHES "test")
      target_link_libraries(${header} PRIVATE GTest::gtest)
    endif()
    target_precompile_headers(${header} PRIVATE ${headers_${kind}})
  endif()
  # GCC 12 forgets in a precompiled header where it may not warn of its own std::string.
  target_compile_options(${target} PRIVATE ${OpenMP_CXX_FLAGS}
    "$<$<CXX_COMPILER_ID:GNU>:-Wno-stringop-overflow;-Wno-stringop-overread;-Wno-array-bounds>")
  target_precompile_headers(${target} REUSE_FROM ${header})
  set_target_properties(${target} PROPERTIES UNITY_BUILD ON UNITY_BUILD_BATCH_SIZE 8)
endfunction()

function(supertac_precompile_folder folder)
  get_property(targets DIRECTORY ${folder} PROPERTY BUILDSYSTEM_TARGETS)
  foreach(target ${targets})
    supertac_precompile(${target})
  endforeach()
  get_property(folders DIRECTORY ${folder} PROPERTY SUBDIRECTORIES)
  foreach(inner ${folders})
    supertac_precompile_folder(${inner})
  endforeach()
endfunction()
supertac_precompile_folder(${PROJECT_SOURCE_DIR})
