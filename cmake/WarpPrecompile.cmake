# Headers that are compiled once and put before sources: to parse MLIR, our
# operations or pybind11 takes longer than most of what follows them.
#
# warp_precompile(NAME HEADER [OBJECT] [ON NAME] [FLAGS ...] [INCLUDES ...]
#                 [DEPENDS ...])
#
# makes lib/NAME.pch in the build folder from HEADER, on top of another one, and
# a target Precompiled_NAME. FLAGS and INCLUDES are those of its users. With
# OBJECT, functions of the header are compiled once, too, to lib/NAME.o, which
# users have to link.
#
# ccache goes by the checksum beside the file, so that clones share objects. It
# is of what is left of the header's text without comments, macros included.
function(warp_precompile name header)
  cmake_parse_arguments(arg "OBJECT" "ON" "FLAGS;INCLUDES;DEPENDS" ${ARGN})
  set(result "${PROJECT_BINARY_DIR}/lib/${name}.pch")
  set(depends "${header}" ${arg_DEPENDS})
  string(TOUPPER "${CMAKE_BUILD_TYPE}" type)
  separate_arguments(flags UNIX_COMMAND
    "${CMAKE_CXX_FLAGS} ${CMAKE_CXX_FLAGS_${type}}")
  if(CMAKE_CROSSCOMPILING)
    list(APPEND flags "--target=${CMAKE_CXX_COMPILER_TARGET}"
      "--sysroot=${CMAKE_SYSROOT}")
  endif()
  list(APPEND flags ${arg_FLAGS} -std=c++20 -fPIC -fvisibility=hidden
    -fvisibility-inlines-hidden -ffunction-sections -fdata-sections)
  if(arg_OBJECT)
    list(APPEND flags -fpch-codegen)
  endif()
  file(WRITE "${result}.flags" "${CMAKE_CXX_COMPILER_VERSION} ${flags}")
  set(compile "${CMAKE_CXX_COMPILER}" ${flags} ${arg_INCLUDES}
    "-ffile-prefix-map=${PROJECT_SOURCE_DIR}=.")
  set(sums "${result}.flags" "${result}.text")
  if(arg_ON)
    set(base "${PROJECT_BINARY_DIR}/lib/${arg_ON}.pch")
    list(APPEND compile -include-pch "${base}")
    list(APPEND depends "${base}")
    list(APPEND sums "${base}.sum")
  endif()
  add_custom_command(OUTPUT "${result}"
    COMMAND ${compile} -Xclang -fno-pch-timestamp -fpch-instantiate-templates
      -MD -MF "${result}.d" -MT "${result}" -x c++-header "${header}"
      -o "${result}"
    COMMAND ${compile} -E -P -dD -x c++ "${header}" -o "${result}.text"
    COMMAND cat ${sums} | sha256sum > "${result}.sum"
    COMMAND "${CMAKE_COMMAND}" -E rm "${result}.text"
    DEPENDS ${depends} DEPFILE "${result}.d"
    COMMENT "Precompiling ${name}" VERBATIM)
  set(made "${result}")
  if(arg_OBJECT)
    set(object "${PROJECT_BINARY_DIR}/lib/${name}.o")
    add_custom_command(OUTPUT "${object}"
      COMMAND "${CMAKE_CXX_COMPILER}" ${flags} -c "${result}" -o "${object}"
      DEPENDS "${result}" COMMENT "Compiling functions of ${name}" VERBATIM)
    list(APPEND made "${object}")
  endif()
  add_custom_target(Precompiled_${name} DEPENDS ${made})
endfunction()

# warp_use_precompiled(TARGET NAME): sources of TARGET begin with a header that
# is compiled already. Paths are relative to the build folder, where Ninja runs.
# A source with COMPILE_OPTIONS of its own goes without.
function(warp_use_precompiled target name)
  if(NOT WARP_PRECOMPILE)
    return()
  endif()
  add_dependencies(${target} Precompiled_${name})
  get_target_property(sources ${target} SOURCES)
  foreach(source IN LISTS sources)
    get_source_file_property(own "${source}" COMPILE_OPTIONS)
    if(NOT own)
      set_property(SOURCE "${source}" APPEND PROPERTY COMPILE_OPTIONS
        -include-pch lib/${name}.pch)
      set_property(SOURCE "${source}" APPEND PROPERTY
        OBJECT_DEPENDS "${PROJECT_BINARY_DIR}/lib/${name}.pch")
    endif()
  endforeach()
endfunction()

# Upstream and, on top of it, Operations: a change of our operations does not
# parse MLIR anew.
function(warp_precompile_operations)
  if(TARGET Precompiled_Upstream OR NOT WARP_PRECOMPILE)
    return()
  endif()
  set(folders ${LLVM_INCLUDE_DIRS} ${MLIR_INCLUDE_DIRS})
  list(REMOVE_DUPLICATES folders)
  foreach(folder IN LISTS folders)
    list(APPEND upstream -isystem "${folder}")
  endforeach()
  warp_precompile(Upstream "${PROJECT_SOURCE_DIR}/lib/Upstream.h"
    FLAGS ${warp_llvm_definitions} INCLUDES ${upstream})
  warp_precompile(Operations "${PROJECT_SOURCE_DIR}/lib/Operations.h"
    ON Upstream FLAGS ${warp_llvm_definitions}
    INCLUDES -I "${PROJECT_SOURCE_DIR}/include"
      -I "${PROJECT_BINARY_DIR}/include" ${upstream}
    DEPENDS WarpDialectHeaders)
endfunction()
