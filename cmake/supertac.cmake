# Shared rules of all targets: warnings, sanitizers, reproducible floating point.

add_library(supertac_options INTERFACE)
# -Wno-restrict: GCC 12 warns about its own std::string.
# SUPERTAC_SAME_BITS: a product and a sum are only fused where the source says so, so that every instruction set gives
# the same bits. Whoever links a library gets it too: its headers are compiled with the user's flags.
set(SUPERTAC_SAME_BITS -ffp-contract=off)
target_compile_options(supertac_options INTERFACE -Wall -Wextra -Wshadow -Wnon-virtual-dtor
  $<$<CXX_COMPILER_ID:GNU>:-Wno-restrict> ${SUPERTAC_SAME_BITS} -fno-math-errno -fno-trapping-math $<$<BOOL:${SUPERTAC_WERROR}>:-Werror>)
# A program names only the shared libraries that it calls.
target_link_options(supertac_options INTERFACE -Wl,--as-needed)
if(SUPERTAC_SANITIZE)
  target_compile_options(supertac_options INTERFACE -fsanitize=${SUPERTAC_SANITIZE} -fno-omit-frame-pointer
    -fno-sanitize-recover=all)
  target_link_options(supertac_options INTERFACE -fsanitize=${SUPERTAC_SANITIZE})
else()
  target_compile_options(supertac_options INTERFACE $<$<CONFIG:Release>:-U_FORTIFY_SOURCE -D_FORTIFY_SOURCE=2>
    -fstack-protector-strong)
  target_link_options(supertac_options INTERFACE -Wl,-z,relro,-z,now)
endif()

# supertac_library(NAME SOURCES a.cpp ... [USES target ...] [PRIVATE_USES target ...])
function(supertac_library name)
  cmake_parse_arguments(arg "" "" "SOURCES;USES;PRIVATE_USES" ${ARGN})
  add_library(${name} STATIC ${arg_SOURCES})
  add_library(supertac::${name} ALIAS ${name})
  target_include_directories(${name} PUBLIC $<BUILD_INTERFACE:${PROJECT_SOURCE_DIR}>
    $<INSTALL_INTERFACE:${CMAKE_INSTALL_INCLUDEDIR}>)
  target_compile_features(${name} PUBLIC cxx_std_20)
  target_compile_options(${name} INTERFACE ${SUPERTAC_SAME_BITS})
  target_link_libraries(${name} PUBLIC ${arg_USES} PRIVATE $<BUILD_INTERFACE:supertac_options> ${arg_PRIVATE_USES})
  set_property(GLOBAL APPEND PROPERTY SUPERTAC_LIBRARIES ${name})
endfunction()

# supertac_group(NAME target ...): a name for several libraries.
function(supertac_group name)
  add_library(${name} INTERFACE)
  add_library(supertac::${name} ALIAS ${name})
  target_link_libraries(${name} INTERFACE ${ARGN})
  set_property(GLOBAL APPEND PROPERTY SUPERTAC_LIBRARIES ${name})
endfunction()

# The same sources twice: NAME with real = float and NAME_f64 with real = double (for gradient checks).
# USES lists plain targets, USES_BOTH targets that exist in both precisions.
function(supertac_library_both name)
  cmake_parse_arguments(arg "" "" "SOURCES;USES;USES_BOTH;PRIVATE_USES" ${ARGN})
  supertac_library(${name} SOURCES ${arg_SOURCES} USES ${arg_USES} ${arg_USES_BOTH}
    PRIVATE_USES ${arg_PRIVATE_USES})
  list(TRANSFORM arg_USES_BOTH APPEND _f64)
  add_library(${name}_f64 STATIC EXCLUDE_FROM_ALL ${arg_SOURCES})
  target_include_directories(${name}_f64 PUBLIC ${PROJECT_SOURCE_DIR})
  target_compile_definitions(${name}_f64 PUBLIC SUPERTAC_REAL_IS_DOUBLE)
  target_link_libraries(${name}_f64 PUBLIC ${arg_USES} ${arg_USES_BOTH}
    PRIVATE supertac_options ${arg_PRIVATE_USES})
endfunction()

# Seconds; a sanitizer makes some tests ten times as slow.
set(SUPERTAC_TEST_TIMEOUT 1500)
if(SUPERTAC_SANITIZE)
  set(SUPERTAC_TEST_TIMEOUT 3600)
endif()

# supertac_cases(NAME [PREFIX text] [SLOW pattern ...] [SERIAL pattern ...]): every case of a GoogleTest program as a ctest
# case, labelled `slow` where a pattern of SLOW matches (as in --gtest_filter), else `quick`: `ctest -L quick` ends within
# half a minute. What SERIAL matches, which SLOW may match too, runs alone.
function(supertac_cases name)
  cmake_parse_arguments(arg "" "PREFIX" "SLOW;SERIAL" ${ARGN})
  get_target_property(sources ${name} SOURCES)
  list(TRANSFORM sources PREPEND ${CMAKE_CURRENT_SOURCE_DIR}/)
  set_property(GLOBAL APPEND PROPERTY SUPERTAC_TEST_SOURCES ${sources})
  list(JOIN arg_SLOW ":" slow)
  list(JOIN arg_SERIAL ":" serial)
  set(properties DISCOVERY_TIMEOUT 60 PROPERTIES TIMEOUT ${SUPERTAC_TEST_TIMEOUT} LABELS)
  if(NOT slow STREQUAL "*")
    gtest_discover_tests(${name} TEST_PREFIX "${arg_PREFIX}" TEST_FILTER "-${slow}:${serial}" ${properties} quick)
  endif()
  if(slow)
    gtest_discover_tests(${name} TEST_PREFIX "${arg_PREFIX}" TEST_FILTER "${slow}-${serial}" ${properties} slow)
  endif()
  # A virtual rig in real time: what else runs would starve it.
  if(serial)
    gtest_discover_tests(${name} TEST_PREFIX "${arg_PREFIX}" TEST_FILTER "${serial}" ${properties} slow RUN_SERIAL ON)
  endif()
endfunction()

# supertac_test(NAME SOURCES a_test.cpp ... USES target ... [SLOW pattern ...]): one GoogleTest program.
function(supertac_test name)
  cmake_parse_arguments(arg "" "" "SOURCES;USES;SLOW;SERIAL" ${ARGN})
  add_executable(${name} ${arg_SOURCES})
  target_link_libraries(${name} PRIVATE ${arg_USES} supertac_options GTest::gtest GTest::gtest_main)
  supertac_cases(${name} SLOW ${arg_SLOW} SERIAL ${arg_SERIAL})
endfunction()
