# Binary data inside libwarp.so.
#
# warp_embed_file(NAME FILE [DEPENDS ...]) defines the byte range
#   extern "C" const char warp_NAME_begin[], warp_NAME_end[];
# and appends the assembled object to the global property WARP_EMBEDDED.
#
# warp_embed_compressed(NAME FILE [DEPENDS target...]) does so with the bytes that
# zstd makes of the file.
#
# warp_compile_device_bitcode(NAME TARGET cpu|nvptx|amdgcn SOURCES file...) compiles
# freestanding C++ to LLVM bitcode, NAME_parts.
#
# warp_add_device_bitcode(NAME ...) also makes one module of it and embeds that
# under NAME, compressed for TARGET nvptx.
#
# warp_add_device_objects(NAME SOURCES file... OPTIONS ...) compiles freestanding
# C++ to machine code, once for each level of this processor's family, and embeds
# the objects as NAME_v1, NAME_v3 and NAME_v4 (x86-64), NAME_v8 (aarch64).
#
# warp_add_device_cubins(NAME PARTS bitcode/stem[:registers]...
# ARCHITECTURES 80 90a... PTX 81) assembles parts of bitcode (TARGET nvptx) into
# relocatable objects for each architecture, of at most so many registers, and
# embeds all as one compressed archive.
#
# warp_add_device_kernels(NAME SOURCES file... ASSEMBLED stem...) compiles files of
# kernels in freestanding C++ to PTX and embeds an archive of them as NAME_ptx;
# those that are assembled, too, as NAME_ampere and NAME_hopper. Clang takes them
# as CUDA for the sake of a few attributes; no toolkit is needed.

function(warp_embed_file name file)
  cmake_parse_arguments(arg "" "" "DEPENDS" ${ARGN})
  set(assembly "${PROJECT_BINARY_DIR}/embedded/${name}.S")
  file(CONFIGURE OUTPUT "${assembly}" @ONLY CONTENT [[
  .section .rodata.warp_@name@,"a",@progbits
  .balign 16
  .global warp_@name@_begin
  .hidden warp_@name@_begin
  .global warp_@name@_end
  .hidden warp_@name@_end
warp_@name@_begin:
  .incbin "@file@"
warp_@name@_end:
  .byte 0
  .section .note.GNU-stack,"",@progbits
]])
  set_source_files_properties("${assembly}" PROPERTIES
    OBJECT_DEPENDS "${file}" GENERATED TRUE)
  add_library(warp_embed_${name} OBJECT "${assembly}")
  # The bytes come from a file that the preprocessed text does not show.
  set_target_properties(warp_embed_${name} PROPERTIES
    ASM_COMPILER_LAUNCHER "")
  set_property(GLOBAL APPEND PROPERTY WARP_EMBEDDED warp_embed_${name})
endfunction()

function(warp_embed_compressed name file)
  cmake_parse_arguments(arg "" "" "DEPENDS" ${ARGN})
  set(packed "${PROJECT_BINARY_DIR}/embedded/${name}.zst")
  add_custom_command(OUTPUT "${packed}"
    COMMAND "${WARP_ZSTD_TOOL}" -q -f --ultra -22 --long=27 "${file}"
      -o "${packed}"
    DEPENDS "${file}" VERBATIM)
  add_custom_target(${name}_packed DEPENDS "${packed}")
  if(arg_DEPENDS)
    add_dependencies(${name}_packed ${arg_DEPENDS})
  endif()
  warp_embed_file(${name} "${packed}")
  add_dependencies(warp_embed_${name} ${name}_packed)
endfunction()

# What all of them are compiled against.
set(prototypes "${PROJECT_BINARY_DIR}/include/DeviceLib/Prototypes.h")

# Functions that become part of a kernel take vectors of 512 bits as values, which
# Clang does for this triple and level alone; the code that links them sets its own.
set(warp_bitcode_triple x86_64-unknown-linux-gnu)
# Atomics are instructions: kernels find no functions of libgcc.
if(WARP_PROCESSOR STREQUAL "aarch64")
  set(warp_cpu_triple aarch64-unknown-linux-gnu)
  set(warp_cpu_flags -mno-outline-atomics)
  set(warp_cpu_levels v8:armv8-a)
else()
  set(warp_cpu_triple x86_64-unknown-linux-gnu)
  set(warp_cpu_flags -mno-red-zone)
  set(warp_object_flags -mprefer-vector-width=512)
  set(warp_cpu_levels v1:x86-64 v3:x86-64-v3 v4:x86-64-v4)
endif()

function(warp_compile_device_bitcode name)
  cmake_parse_arguments(arg "" "TARGET" "SOURCES;OPTIONS" ${ARGN})
  if(arg_TARGET STREQUAL "cpu")
    set(triple ${warp_bitcode_triple})
    set(flags -fPIC -mno-red-zone)
  elseif(arg_TARGET STREQUAL "nvptx")
    set(triple nvptx64-nvidia-cuda)
    set(flags -DWARP_GPU -nogpulib -Xclang -target-feature -Xclang +ptx80)
  elseif(arg_TARGET STREQUAL "amdgcn")
    set(triple amdgcn-amd-amdhsa)
    set(flags -DWARP_GPU -nogpulib)
  else()
    message(FATAL_ERROR "unknown device target '${arg_TARGET}', "
      "expected 'cpu', 'nvptx' or 'amdgcn'")
  endif()
  set(folder "${PROJECT_BINARY_DIR}/bitcode/${name}")
  file(MAKE_DIRECTORY "${folder}")
  set(parts "")
  foreach(source IN LISTS arg_SOURCES)
    get_filename_component(source "${source}" ABSOLUTE)
    get_filename_component(stem "${source}" NAME_WE)
    set(part "${folder}/${stem}.bc")
    add_custom_command(OUTPUT "${part}"
      COMMAND "${WARP_CLANG}" --target=${triple} -std=c++20 -O2 ${flags}
        -ffreestanding -fno-exceptions -fno-rtti -fno-math-errno
        -ffp-contract=off -fvisibility=hidden -nostdinc++
        -I "${PROJECT_SOURCE_DIR}/lib/DeviceLib"
        -I "${PROJECT_BINARY_DIR}/include" ${arg_OPTIONS}
        -MD -MF "${part}.d" -MT "${part}"
        -emit-llvm -c "${source}" -o "${part}"
      DEPENDS "${source}" "${prototypes}" DEPFILE "${part}.d"
      COMMENT "Building ${arg_TARGET} bitcode ${stem}" VERBATIM)
    list(APPEND parts "${part}")
  endforeach()
  add_custom_target(${name}_parts DEPENDS ${parts})
  set(${name}_parts "${parts}" PARENT_SCOPE)
endfunction()

# Without embedding it.
function(warp_link_device_bitcode name)
  warp_compile_device_bitcode(${name} ${ARGN})
  set(linked "${PROJECT_BINARY_DIR}/bitcode/${name}/${name}.bc")
  add_custom_command(OUTPUT "${linked}"
    COMMAND "${WARP_LLVM_LINK}" --preserve-bc-uselistorder=false
      ${${name}_parts} -o "${linked}"
    DEPENDS ${${name}_parts} VERBATIM)
  add_custom_target(${name}_bitcode DEPENDS "${linked}")
  set(${name}_linked "${linked}" PARENT_SCOPE)
endfunction()

function(warp_add_device_bitcode name)
  warp_link_device_bitcode(${name} ${ARGN})
  set(linked "${${name}_linked}")
  cmake_parse_arguments(arg "" "TARGET" "" ${ARGN})
  if(arg_TARGET STREQUAL "nvptx")
    warp_embed_compressed(${name} "${linked}" DEPENDS ${name}_bitcode)
  else()
    warp_embed_file(${name} "${linked}")
    add_dependencies(warp_embed_${name} ${name}_bitcode)
  endif()
endfunction()

function(warp_add_device_objects name)
  cmake_parse_arguments(arg "" "" "SOURCES;OPTIONS" ${ARGN})
  foreach(level IN LISTS warp_cpu_levels)
    string(REGEX MATCH "(.*):(.*)" level "${level}")
    set(level "${CMAKE_MATCH_1}")
    set(processor "${CMAKE_MATCH_2}")
    set(folder "${PROJECT_BINARY_DIR}/bitcode/${name}_${level}")
    file(MAKE_DIRECTORY "${folder}")
    set(parts "")
    foreach(source IN LISTS arg_SOURCES)
      get_filename_component(source "${source}" ABSOLUTE)
      get_filename_component(stem "${source}" NAME_WE)
      set(part "${folder}/${stem}.o")
      # Vectors wider than registers never cross the border of the library.
      add_custom_command(OUTPUT "${part}"
        COMMAND "${WARP_CLANG}" --target=${warp_cpu_triple} -std=c++20 -O2
          -march=${processor} -fPIC ${warp_cpu_flags} ${warp_object_flags}
          -ffreestanding -fno-exceptions -fno-rtti -fno-math-errno
          -fno-asynchronous-unwind-tables -ffp-contract=off -fvisibility=hidden
          -nostdinc++ -Wno-psabi -I "${PROJECT_SOURCE_DIR}/lib/DeviceLib"
          -I "${PROJECT_BINARY_DIR}/include" ${arg_OPTIONS} -MD -MF "${part}.d" -MT "${part}"
          -c "${source}" -o "${part}"
        DEPENDS "${source}" "${prototypes}" DEPFILE "${part}.d"
        COMMENT "Building ${processor} object ${stem}" VERBATIM)
      list(APPEND parts "${part}")
    endforeach()
    set(linked "${folder}/${name}.o")
    add_custom_command(OUTPUT "${linked}"
      COMMAND "${WARP_CLANG}" --target=${warp_cpu_triple} -fuse-ld=lld -nostdlib -r
        ${parts} -o "${linked}"
      DEPENDS ${parts} VERBATIM)
    add_custom_target(${name}_${level}_object DEPENDS "${linked}")
    warp_embed_file(${name}_${level} "${linked}")
    add_dependencies(warp_embed_${name}_${level} ${name}_${level}_object)
  endforeach()
endfunction()

# Embeds files as one compressed archive; rules of the targets in DEPENDS make
# them.
function(warp_embed_archive name folder)
  cmake_parse_arguments(arg "" "" "FILES;DEPENDS" ${ARGN})
  set(archive "${folder}/${name}.a")
  add_custom_command(OUTPUT "${archive}"
    COMMAND "${CMAKE_COMMAND}" -E rm -f "${archive}"
    COMMAND "${WARP_LLVM_AR}" rcSD "${archive}" ${arg_FILES}
    DEPENDS ${arg_FILES} VERBATIM)
  add_custom_target(${name}_archive DEPENDS "${archive}")
  if(arg_DEPENDS)
    add_dependencies(${name}_archive ${arg_DEPENDS})
  endif()
  warp_embed_compressed(${name} "${archive}" DEPENDS ${name}_archive)
endfunction()

function(warp_add_device_cubins name)
  cmake_parse_arguments(arg "" "PTX" "PARTS;ARCHITECTURES" ${ARGN})
  set(folder "${PROJECT_BINARY_DIR}/bitcode/${name}")
  file(MAKE_DIRECTORY "${folder}")
  set(cubins "")
  set(made "")
  foreach(part IN LISTS arg_PARTS)
    string(REPLACE ":" ";" part "${part}")
    list(POP_FRONT part path)
    set(bitcode "${PROJECT_BINARY_DIR}/bitcode/${path}.bc")
    get_filename_component(stem "${path}" NAME)
    get_filename_component(from "${path}" DIRECTORY)
    list(APPEND made ${from}_parts)
    list(TRANSFORM part PREPEND "-maxrregcount=" OUTPUT_VARIABLE registers)
    foreach(architecture IN LISTS arg_ARCHITECTURES)
      set(target "sm_${architecture}")
      set(ptx "${folder}/${target}.${stem}.ptx")
      set(cubin "${folder}/${target}.${stem}.cubin")
      add_custom_command(OUTPUT "${cubin}"
        COMMAND "${WARP_CLANG}" --target=nvptx64-nvidia-cuda -march=${target}
          -O2 -nogpulib -Wno-unknown-cuda-version -Wno-pass-failed
          -mllvm -inline-threshold=700
          -Xclang -target-feature -Xclang +ptx${arg_PTX}
          -Xclang -mlink-builtin-bitcode -Xclang "${WARP_LIBDEVICE}"
          -S -x ir "${bitcode}" -o "${ptx}"
        # Its remarks are about speed, and of interest only if it fails.
        COMMAND sh -c "remarks=$(\"$0\" \"$@\" 2>&1) || { echo \"$remarks\"; exit 1; }"
          "${WARP_PTXAS}" -c -arch=${target} ${registers} "${ptx}" -o "${cubin}"
        DEPENDS "${bitcode}" COMMENT "Assembling ${stem} for ${target}" VERBATIM)
      list(APPEND cubins "${cubin}")
    endforeach()
  endforeach()
  warp_embed_archive(${name} "${folder}"
    FILES ${cubins} DEPENDS ${made})
endfunction()

function(warp_add_device_kernels name)
  cmake_parse_arguments(arg "" "" "SOURCES;ASSEMBLED" ${ARGN})
  set(folder "${PROJECT_BINARY_DIR}/bitcode/${name}")
  file(MAKE_DIRECTORY "${folder}")
  set(files "")
  set(ampere "")
  set(hopper "")
  foreach(source IN LISTS arg_SOURCES)
    get_filename_component(source "${source}" ABSOLUTE)
    get_filename_component(stem "${source}" NAME_WE)
    set(ptx "${folder}/${stem}.ptx")
    add_custom_command(OUTPUT "${ptx}"
      COMMAND "${WARP_CLANG}" -x cuda --cuda-device-only --cuda-gpu-arch=sm_75
        -nocudainc -nocudalib -Wno-unknown-cuda-version
        -Xclang -target-feature -Xclang -ptx88
        -Xclang -target-feature -Xclang +ptx80
        -std=c++20 -O3 -ffreestanding -fno-exceptions -fno-rtti
        -ffp-contract=off -fvisibility=hidden -nostdinc++ -Wall -Wextra
        -MD -MF "${ptx}.d" -MT "${ptx}" -S "${source}" -o "${ptx}"
      DEPENDS "${source}" DEPFILE "${ptx}.d"
      COMMENT "Building PTX ${stem}" VERBATIM)
    list(APPEND files "${ptx}")
    if(NOT stem IN_LIST arg_ASSEMBLED)
      continue()
    endif()
    set(cubin "${folder}/sm_80.${stem}.cubin")
    add_custom_command(OUTPUT "${cubin}"
      COMMAND "${WARP_PTXAS}" -arch=sm_80 "${ptx}" -o "${cubin}"
      DEPENDS "${ptx}" VERBATIM)
    list(APPEND ampere "${cubin}")
    set(cubin "${folder}/sm_90.${stem}.cubin")
    set(waiting "${folder}/sm_90.${stem}.ptx")
    add_custom_command(OUTPUT "${cubin}"
      COMMAND "${CMAKE_COMMAND}" -DIN=${ptx} -DOUT=${waiting}
        -P "${PROJECT_SOURCE_DIR}/cmake/WaitingKernels.cmake"
      COMMAND "${WARP_PTXAS}" -arch=sm_90 "${waiting}" -o "${cubin}"
      DEPENDS "${ptx}" "${PROJECT_SOURCE_DIR}/cmake/WaitingKernels.cmake"
      VERBATIM)
    list(APPEND hopper "${cubin}")
  endforeach()
  warp_embed_archive(${name}_ptx "${folder}" FILES ${files})
  warp_embed_archive(${name}_ampere "${folder}" FILES ${ampere})
  warp_embed_archive(${name}_hopper "${folder}" FILES ${hopper})
endfunction()
