# Run by cmake --install. Inside the tree headers include "layers/linear.h"; installed ones include
# "supertac/layers/linear.h", so that one prefix is all that a user's program sees of them.
set(staged "${SUPERTAC_BUILD}/installed_headers")
file(REMOVE_RECURSE "${staged}")
foreach(folder IN ITEMS io autograd layers data models hardware)
  file(GLOB_RECURSE headers RELATIVE "${SUPERTAC_SOURCE}" "${SUPERTAC_SOURCE}/${folder}/*.h")
  foreach(header IN LISTS headers)
    file(READ "${SUPERTAC_SOURCE}/${header}" text)
    string(REGEX REPLACE "#include \"(io|autograd|layers|data|models|hardware)/" "#include \"supertac/\\1/" text "${text}")
    file(WRITE "${staged}/${header}" "${text}")
  endforeach()
endforeach()
cmake_path(ABSOLUTE_PATH SUPERTAC_INCLUDEDIR BASE_DIRECTORY "${CMAKE_INSTALL_PREFIX}")
file(INSTALL "${staged}/" DESTINATION "${SUPERTAC_INCLUDEDIR}/supertac")
