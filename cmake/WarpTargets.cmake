# warp_add_objects(NAME [LLVM] [DEPENDS target...])
#
# One object library from every .cpp file under the current folder. With LLVM,
# sources see the LLVM/MLIR and dialect headers and wait for generated ones.
# A folder without sources defines an empty interface library of that name.
function(warp_add_objects name)
  cmake_parse_arguments(arg "LLVM" "" "DEPENDS" ${ARGN})
  file(GLOB_RECURSE sources CONFIGURE_DEPENDS
    "${CMAKE_CURRENT_SOURCE_DIR}/*.cpp")
  if(NOT sources)
    add_library(${name} INTERFACE)
    return()
  endif()
  add_library(${name} OBJECT ${sources})
  target_include_directories(${name} PUBLIC
    "${PROJECT_SOURCE_DIR}/include" "${PROJECT_BINARY_DIR}/include")
  target_include_directories(${name} PRIVATE
    "${CMAKE_CURRENT_SOURCE_DIR}" "${PROJECT_SOURCE_DIR}/lib")
  target_compile_definitions(${name} PRIVATE
    WARP_VERSION="${PROJECT_VERSION}")
  if(arg_LLVM)
    target_link_libraries(${name} PUBLIC warp_llvm)
    add_dependencies(${name} WarpDialectHeaders)
    warp_use_precompiled(${name})
  endif()
  if(arg_DEPENDS)
    add_dependencies(${name} ${arg_DEPENDS})
  endif()
endfunction()

# warp_use_precompiled(TARGET): sources of TARGET begin with lib/Upstream.h,
# compiled once: parsing MLIR's headers is three quarters of the time that a
# source takes. Paths are relative to the build folder, where Ninja runs, and
# ccache goes by the checksum beside the file, so that clones share objects.
# A source with COMPILE_OPTIONS of its own goes without.
function(warp_use_precompiled target)
  if(NOT WARP_PRECOMPILE)
    return()
  endif()
  set(header "${PROJECT_SOURCE_DIR}/lib/Upstream.h")
  set(precompiled "${PROJECT_BINARY_DIR}/lib/Upstream.pch")
  if(NOT TARGET WarpUpstream)
    string(TOUPPER "${CMAKE_BUILD_TYPE}" type)
    separate_arguments(flags UNIX_COMMAND
      "${CMAKE_CXX_FLAGS} ${CMAKE_CXX_FLAGS_${type}}")
    list(APPEND flags ${warp_llvm_definitions} -std=c++20 -fPIC
      -fvisibility=hidden -fvisibility-inlines-hidden)
    foreach(folder IN LISTS LLVM_INCLUDE_DIRS MLIR_INCLUDE_DIRS)
      list(APPEND flags -isystem "${folder}")
    endforeach()
    add_custom_command(OUTPUT "${precompiled}"
      COMMAND "${CMAKE_CXX_COMPILER}" ${flags} -Xclang -fno-pch-timestamp
        -fpch-instantiate-templates -x c++-header "${header}"
        -o "${precompiled}"
      DEPENDS "${header}" COMMENT "Precompiling MLIR's headers" VERBATIM)
    file(SHA256 "${header}" sum)
    string(SHA256 sum "${sum} ${flags} ${LLVM_PACKAGE_VERSION}")
    file(WRITE "${precompiled}.sum" "${sum}")
    set_property(DIRECTORY "${PROJECT_SOURCE_DIR}" APPEND PROPERTY
      CMAKE_CONFIGURE_DEPENDS "${header}")
    add_custom_target(WarpUpstream DEPENDS "${precompiled}")
  endif()
  add_dependencies(${target} WarpUpstream)
  get_target_property(sources ${target} SOURCES)
  foreach(source IN LISTS sources)
    get_source_file_property(own "${source}" COMPILE_OPTIONS)
    if(NOT own)
      set_property(SOURCE "${source}" APPEND PROPERTY COMPILE_OPTIONS
        -include-pch lib/Upstream.pch)
      set_property(SOURCE "${source}" APPEND PROPERTY
        OBJECT_DEPENDS "${precompiled}")
    endif()
  endforeach()
endfunction()

# warp_have_sources(VARIABLE): does the current folder hold any .cpp file?
function(warp_have_sources variable)
  file(GLOB_RECURSE sources CONFIGURE_DEPENDS
    "${CMAKE_CURRENT_SOURCE_DIR}/*.cpp")
  set(${variable} "${sources}" PARENT_SCOPE)
endfunction()
