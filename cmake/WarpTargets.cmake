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
  add_dependencies(${name} WarpHandleKinds WarpLaunchContract)
  if(arg_LLVM)
    target_link_libraries(${name} PUBLIC warp_llvm)
    add_dependencies(${name} WarpDialectHeaders)
    warp_precompile_operations()
    warp_use_precompiled(${name} Operations)
  endif()
  if(arg_DEPENDS)
    add_dependencies(${name} ${arg_DEPENDS})
  endif()
endfunction()

# warp_have_sources(VARIABLE): does the current folder hold any .cpp file?
function(warp_have_sources variable)
  file(GLOB_RECURSE sources CONFIGURE_DEPENDS
    "${CMAKE_CURRENT_SOURCE_DIR}/*.cpp")
  set(${variable} "${sources}" PARENT_SCOPE)
endfunction()
