# Man pages, completion, the bill of materials, and cpack -G DEB.
get_property(jobs GLOBAL PROPERTY SUPERTAC_PROGRAM_TARGETS)
set(share ${CMAKE_CURRENT_BINARY_DIR}/share)
foreach(program supertac supertac-sweep ${jobs})
  install(FILES ${CMAKE_CURRENT_SOURCE_DIR}/packaging/completion.bash RENAME ${program}
    DESTINATION ${CMAKE_INSTALL_DATADIR}/bash-completion/completions COMPONENT programs)
endforeach()
install(FILES docs/glossary.md DESTINATION ${CMAKE_INSTALL_DOCDIR} COMPONENT programs)

find_program(SUPERTAC_HELP2MAN help2man)
if(SUPERTAC_HELP2MAN)
  foreach(program ${jobs})
    set(page ${share}/man/${program}.1)
    add_custom_command(OUTPUT ${page}.gz DEPENDS ${program}
      COMMAND ${CMAKE_COMMAND} -E make_directory ${share}/man
      COMMAND ${SUPERTAC_HELP2MAN} --no-info --version-string=${PROJECT_VERSION} --section=1
        --name "$<TARGET_PROPERTY:${program},SUPERTAC_PURPOSE>" --output ${page} $<TARGET_FILE:${program}>
      COMMAND gzip -9nf ${page}
      COMMENT "" VERBATIM)
    list(APPEND pages ${page}.gz)
  endforeach()
  add_custom_target(supertac_man ALL DEPENDS ${pages})
  install(FILES ${pages} DESTINATION ${CMAKE_INSTALL_MANDIR}/man1 COMPONENT programs)
endif()

find_program(SUPERTAC_DPKG dpkg-query)
find_package(Python3 COMPONENTS Interpreter)
if(SUPERTAC_DPKG AND Python3_FOUND)
  add_custom_command(OUTPUT ${share}/supertac.cdx.json DEPENDS ${jobs} packaging/sbom.py
    COMMAND ${Python3_EXECUTABLE} ${CMAKE_CURRENT_SOURCE_DIR}/packaging/sbom.py ${PROJECT_BINARY_DIR}/bin --version
      ${PROJECT_VERSION} --out ${share}/supertac.cdx.json
    COMMENT "" VERBATIM)
  add_custom_target(supertac_sbom ALL DEPENDS ${share}/supertac.cdx.json)
  install(FILES ${share}/supertac.cdx.json DESTINATION ${CMAKE_INSTALL_DOCDIR} COMPONENT programs)
endif()

# What Debian's policy asks of every package. The address takes no mail: SECURITY.md and CONTRIBUTING.md say who does.
set(maintainer "The SuperTac authors <supertac@users.noreply.github.com>")
string(TIMESTAMP date "%a, %d %b %Y %H:%M:%S +0000" UTC)
foreach(package "supertac;programs" "supertac-dev;development")
  list(GET package 0 name)
  list(GET package 1 component)
  set(doc ${share}/doc/${name})
  file(CONFIGURE OUTPUT ${doc}/changelog CONTENT "supertac (@PROJECT_VERSION@) unstable; urgency=medium

  * CHANGELOG.md of the sources says what is new.

 -- @maintainer@  @date@
")
  execute_process(COMMAND gzip -9nf ${doc}/changelog)
  install(FILES ${doc}/changelog.gz DESTINATION ${CMAKE_INSTALL_DATAROOTDIR}/doc/${name} COMPONENT ${component})
  install(FILES LICENSE RENAME copyright DESTINATION ${CMAKE_INSTALL_DATAROOTDIR}/doc/${name} COMPONENT ${component})
endforeach()

set(CPACK_GENERATOR DEB)
set(CPACK_PACKAGE_CONTACT "${maintainer}")
set(CPACK_PACKAGING_INSTALL_PREFIX /usr)
set(CPACK_STRIP_FILES ON)
set(CPACK_PRE_BUILD_SCRIPTS ${CMAKE_CURRENT_SOURCE_DIR}/packaging/permissions.cmake)
set(CPACK_COMPONENTS_ALL programs development)
set(CPACK_DEB_COMPONENT_INSTALL ON)
set(CPACK_DEBIAN_PROGRAMS_PACKAGE_NAME supertac)
set(CPACK_DEBIAN_DEVELOPMENT_PACKAGE_NAME supertac-dev)
set(CPACK_DEBIAN_PROGRAMS_PACKAGE_SHLIBDEPS ON)
# libsupertac.so.0: what others link to it needs this package, and the linker's cache is made anew.
set(CPACK_DEBIAN_PACKAGE_GENERATE_SHLIBS ON)
file(WRITE ${share}/triggers "activate-noawait ldconfig\n")
set(CPACK_DEBIAN_PROGRAMS_PACKAGE_CONTROL_EXTRA ${share}/triggers)
set(CPACK_DEBIAN_PROGRAMS_PACKAGE_SUGGESTS gnuplot)
set(CPACK_DEBIAN_DEVELOPMENT_PACKAGE_DEPENDS "supertac (= ${PROJECT_VERSION}), g++, libkissfft-dev, nlohmann-json3-dev, zlib1g-dev")
set(CPACK_DEBIAN_DEVELOPMENT_PACKAGE_SECTION libdevel)
set(CPACK_DEBIAN_PACKAGE_SECTION science)
set(CPACK_DEBIAN_FILE_NAME DEB-DEFAULT)
set(CPACK_COMPONENT_PROGRAMS_DESCRIPTION "Tactile super-resolution: simulate, record, train, evaluate, stream.")
set(CPACK_COMPONENT_DEVELOPMENT_DESCRIPTION "Libraries and headers of SuperTac.")
include(CPack)
