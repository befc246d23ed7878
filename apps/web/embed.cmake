cmake_minimum_required(VERSION 3.22)
# Run at build time: writes OUTPUT, which defines supertac::NAME(), the page HTML with STYLES and SCRIPT in it.
set(folder ${CMAKE_CURRENT_LIST_DIR})
file(READ ${folder}/${HTML} page)
set(style "")
foreach(file ${STYLES})
  file(READ ${folder}/${file} text)
  string(APPEND style "${text}")
endforeach()
file(READ ${folder}/${SCRIPT} script)
string(REPLACE "{{style}}" "${style}" page "${page}")
string(REPLACE "{{script}}" "${script}" page "${page}")
file(WRITE ${OUTPUT} "#include \"apps/web/pages.h\"

std::string_view supertac::${NAME}() {
  return R\"page~(${page})page~\";
}
")
