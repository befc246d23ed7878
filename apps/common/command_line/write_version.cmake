cmake_minimum_required(VERSION 3.22)
# Run at build time: writes OUTPUT, which defines supertac::commit(), from the checkout SOURCE.
set(commit "unknown")
find_program(git git)
if(git)
  execute_process(COMMAND ${git} -C ${SOURCE} describe --always --dirty --abbrev=12 --exclude=*
    OUTPUT_VARIABLE found RESULT_VARIABLE code OUTPUT_STRIP_TRAILING_WHITESPACE ERROR_QUIET)
  if(code EQUAL 0)
    set(commit "${found}")
  endif()
endif()
file(CONFIGURE OUTPUT ${OUTPUT} @ONLY CONTENT
"namespace supertac { const char* commit(); }

const char* supertac::commit() { return \"@commit@\"; }
")
