# Python for the extension module and the tests: the interpreter named on the
# command line, else .venv, else what is found; pybind11 from its packages.
#
# A build for another processor runs this machine's interpreter, and takes
# headers from the root.

if(NOT Python_EXECUTABLE AND EXISTS "${PROJECT_SOURCE_DIR}/.venv/bin/python")
  set(Python_EXECUTABLE "${PROJECT_SOURCE_DIR}/.venv/bin/python")
endif()
if(CMAKE_CROSSCOMPILING)
  find_package(Python COMPONENTS Interpreter REQUIRED)
else()
  find_package(Python COMPONENTS Interpreter Development.Module REQUIRED)
endif()
if(NOT pybind11_DIR)
  execute_process(
    COMMAND "${Python_EXECUTABLE}" -m pybind11 --cmakedir
    OUTPUT_VARIABLE pybind11_DIR OUTPUT_STRIP_TRAILING_WHITESPACE
    ERROR_QUIET)
endif()
set(PYBIND11_FINDPYTHON ON)
if(CMAKE_CROSSCOMPILING)
  set(PYBIND11_NOPYTHON ON)
endif()
find_package(pybind11 2.12 REQUIRED CONFIG)
if(CMAKE_CROSSCOMPILING)
  file(GLOB warp_python_headers "${CMAKE_SYSROOT}/usr/include/python3.*")
  if(NOT warp_python_headers)
    message(FATAL_ERROR "no headers of Python in '${CMAKE_SYSROOT}'")
  endif()
  list(GET warp_python_headers 0 Python_INCLUDE_DIRS)
  string(REGEX REPLACE ".*python3." "cpython-3" warp_python_abi
    "${Python_INCLUDE_DIRS}")
  set(warp_python_suffix
    ".${warp_python_abi}-${CMAKE_LIBRARY_ARCHITECTURE}.so")
  # pybind11's needs an interpreter of the other machine.
  function(pybind11_add_module name kind extras)
    add_library(${name} ${kind} ${ARGN})
    target_include_directories(${name} SYSTEM PRIVATE "${Python_INCLUDE_DIRS}")
    target_link_libraries(${name} PRIVATE pybind11::headers)
    set_target_properties(${name} PROPERTIES PREFIX ""
      SUFFIX "${warp_python_suffix}")
  endfunction()
endif()
