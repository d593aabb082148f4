# What others build on: the shared library with its public headers (cmake/public_headers.txt), found by
# find_package(alidade), by pkg-config, or taken in by add_subdirectory. Everything else is private.
include(GNUInstallDirs)
include(CMakePackageConfigHelpers)

# Eigen aligns what it lays out and allocates by the instructions that a compiler may use: who builds on the library with
# others (-march=native, a sanitizer) must lay out as the library does.
get_directory_property(options COMPILE_OPTIONS)
separate_arguments(flags UNIX_COMMAND "${CMAKE_CXX_FLAGS}")
get_target_property(eigen_include Eigen3::Eigen INTERFACE_INCLUDE_DIRECTORIES)
list(TRANSFORM eigen_include PREPEND -I)
file(WRITE ${PROJECT_BINARY_DIR}/eigen_layout.cpp
     "#include <Eigen/Core>\nlayout EIGEN_MAX_ALIGN_BYTES EIGEN_MALLOC_ALREADY_ALIGNED\n")
execute_process(COMMAND ${CMAKE_CXX_COMPILER} ${flags} ${options} ${eigen_include} -std=c++20 -E
                        ${PROJECT_BINARY_DIR}/eigen_layout.cpp OUTPUT_VARIABLE preprocessed ERROR_QUIET)
set(eigen_layout "")
if(preprocessed MATCHES "layout ([0-9]+) ([01])")
  set(eigen_layout EIGEN_MAX_ALIGN_BYTES=${CMAKE_MATCH_1} EIGEN_MALLOC_ALREADY_ALIGNED=${CMAKE_MATCH_2})
endif()
list(TRANSFORM eigen_layout PREPEND -D OUTPUT_VARIABLE eigen_layout_flags)
list(JOIN eigen_layout_flags " " eigen_layout_flags)

add_library(alidade_shared SHARED $<TARGET_OBJECTS:alidade> $<TARGET_OBJECTS:alidade_light>)
if(ALIDADE_WEB)
  target_sources(alidade_shared PRIVATE $<TARGET_OBJECTS:alidade_template>)
endif()
set_target_properties(alidade_shared PROPERTIES OUTPUT_NAME alidade EXPORT_NAME alidade LINKER_LANGUAGE CXX
                                                VERSION ${PROJECT_VERSION} SOVERSION ${PROJECT_VERSION_MAJOR})
target_compile_features(alidade_shared INTERFACE cxx_std_20)
target_compile_definitions(alidade_shared INTERFACE ${eigen_layout})
target_include_directories(alidade_shared INTERFACE $<BUILD_INTERFACE:${PROJECT_SOURCE_DIR}/src>
                                                    $<INSTALL_INTERFACE:${CMAKE_INSTALL_INCLUDEDIR}>)
target_link_libraries(alidade_shared PUBLIC Eigen3::Eigen
                                     PRIVATE ${opencv_libraries} ${image_libraries} TBB::tbb yaml-cpp fmt::fmt Threads::Threads)
if(TARGET pugixml::pugixml)
  target_link_libraries(alidade_shared PRIVATE pugixml::pugixml)
endif()
add_library(alidade::alidade ALIAS alidade_shared)

if(NOT ALIDADE_INSTALL)
  return()
endif()
install(TARGETS alidade_shared EXPORT alidadeTargets LIBRARY DESTINATION ${CMAKE_INSTALL_LIBDIR})
install(TARGETS alidade_cli RUNTIME DESTINATION ${CMAKE_INSTALL_BINDIR})
if(TARGET alidade_video)
  install(TARGETS alidade_video RUNTIME DESTINATION ${CMAKE_INSTALL_BINDIR})  # `alidade` looks for it beside itself
endif()
foreach(program alidade_study alidade_fleet)
  if(TARGET ${program})
    install(TARGETS ${program} RUNTIME DESTINATION ${CMAKE_INSTALL_BINDIR})
  endif()
endforeach()

set_property(DIRECTORY APPEND PROPERTY CMAKE_CONFIGURE_DEPENDS ${PROJECT_SOURCE_DIR}/cmake/public_headers.txt)
file(STRINGS ${PROJECT_SOURCE_DIR}/cmake/public_headers.txt public_headers)
foreach(header ${public_headers})
  get_filename_component(folder ${header} DIRECTORY)
  install(FILES ${PROJECT_SOURCE_DIR}/src/${header} DESTINATION ${CMAKE_INSTALL_INCLUDEDIR}/${folder})
endforeach()

set(package_folder ${CMAKE_INSTALL_LIBDIR}/cmake/alidade)
install(EXPORT alidadeTargets NAMESPACE alidade:: DESTINATION ${package_folder})
configure_package_config_file(${PROJECT_SOURCE_DIR}/cmake/alidadeConfig.cmake.in
                              ${PROJECT_BINARY_DIR}/alidadeConfig.cmake INSTALL_DESTINATION ${package_folder})
write_basic_package_version_file(${PROJECT_BINARY_DIR}/alidadeConfigVersion.cmake COMPATIBILITY SameMinorVersion)
install(FILES ${PROJECT_BINARY_DIR}/alidadeConfig.cmake ${PROJECT_BINARY_DIR}/alidadeConfigVersion.cmake
        DESTINATION ${package_folder})
configure_file(${PROJECT_SOURCE_DIR}/cmake/alidade.pc.in ${PROJECT_BINARY_DIR}/alidade.pc @ONLY)
install(FILES ${PROJECT_BINARY_DIR}/alidade.pc DESTINATION ${CMAKE_INSTALL_LIBDIR}/pkgconfig)

# Man pages and completion are what --help says.
find_package(Python3 COMPONENTS Interpreter)
if(Python3_FOUND)
  install(CODE "execute_process(COMMAND ${Python3_EXECUTABLE} ${PROJECT_SOURCE_DIR}/tools/help_pages.py
                  $<TARGET_FILE:alidade_cli> ${PROJECT_BINARY_DIR}/help_pages COMMAND_ERROR_IS_FATAL ANY)")
  install(DIRECTORY ${PROJECT_BINARY_DIR}/help_pages/man1 DESTINATION ${CMAKE_INSTALL_MANDIR})
  install(FILES ${PROJECT_BINARY_DIR}/help_pages/completions/alidade
          DESTINATION ${CMAKE_INSTALL_DATADIR}/bash-completion/completions)
endif()
