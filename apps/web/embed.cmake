cmake_minimum_required(VERSION 3.22)
# Run at build time: writes OUTPUT, which defines supertac::NAME(): frame.html with TITLE, CLASS of the body, BODY, STYLES and
# SCRIPTS in it; a script that is BODY stands alone.
set(folder ${CMAKE_CURRENT_LIST_DIR}/pages)
file(READ ${folder}/frame.html page)
if(BODY MATCHES "[.]js$")
  set(page "{{body}}")
endif()
file(READ ${folder}/${BODY} body)
foreach(kind STYLES SCRIPTS)
  foreach(file ${${kind}})
    file(READ ${folder}/${file} text)
    string(APPEND all_${kind} "${text}")
  endforeach()
endforeach()
string(REPLACE "{{title}}" "${TITLE}" page "${page}")
string(REPLACE "{{class}}" "${CLASS}" page "${page}")
string(REPLACE "{{style}}" "${all_STYLES}" page "${page}")
string(REPLACE "{{body}}" "${body}" page "${page}")
string(REPLACE "{{script}}" "${all_SCRIPTS}" page "${page}")
file(WRITE ${OUTPUT} "#include <string_view>

namespace supertac {
std::string_view ${NAME}();
std::string_view ${NAME}() {
  return R\"page~(${page})page~\";
}
}
")
