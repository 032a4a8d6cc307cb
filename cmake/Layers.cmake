# One static library per folder of src/. A layer sees only its own headers and those of its dependencies: the include
# directory of a folder contains nothing but a link to it, so that #include "scene/scene.h" does not compile in a layer
# below the scene.

set(ETENDUE_LAYER_INCLUDES ${CMAKE_BINARY_DIR}/layers)

add_library(etendue_options INTERFACE)
target_compile_features(etendue_options INTERFACE cxx_std_20)
target_compile_options(etendue_options INTERFACE
    -Wall -Wextra -Wpedantic -Wnon-virtual-dtor
    $<IF:$<CXX_COMPILER_ID:GNU>,-Wshadow=local,-Wshadow> -Werror
    -fno-math-errno -fno-trapping-math)
if(CMAKE_CXX_COMPILER_ID STREQUAL "GNU")
    # False positives of GCC 12 in inlined code of optionals, variants and strings (GCC bug 105329).
    target_compile_options(etendue_options INTERFACE -Wno-maybe-uninitialized -Wno-restrict)
    if(ETENDUE_PCH)
        # With precompiled headers GCC does not recognise system headers (GCC bug 105651).
        target_compile_options(etendue_options INTERFACE -Wno-array-bounds -Wno-stringop-overflow -Wno-stringop-overread)
    endif()
endif()
if(ETENDUE_UNITY)
    # These are meant for headers, and about names of the same file. Here one source includes others.
    target_compile_options(etendue_options INTERFACE
        -Wno-shadow $<$<CXX_COMPILER_ID:GNU>:-Wno-subobject-linkage>)
endif()
if(ETENDUE_ARCH)
    target_compile_options(etendue_options INTERFACE -march=${ETENDUE_ARCH})
endif()
if(ETENDUE_SANITIZE)
    target_compile_options(etendue_options INTERFACE
        -fsanitize=${ETENDUE_SANITIZE} -fno-sanitize-recover=all -fno-omit-frame-pointer)
    target_link_options(etendue_options INTERFACE -fsanitize=${ETENDUE_SANITIZE})
    if(ETENDUE_SANITIZE STREQUAL "thread")
        # GCC warns about fences in TBB's headers.
        target_include_directories(etendue_options BEFORE INTERFACE ${PROJECT_SOURCE_DIR}/tests/support/tsan)
        target_compile_options(etendue_options INTERFACE $<$<CXX_COMPILER_ID:GNU>:-Wno-tsan>)
    endif()
endif()

# Standard headers that most sources include, precompiled once for all layers. Sources must still include what they use,
# since the preset `clang` has no precompiled headers.
set(ETENDUE_COMMON_HEADERS <algorithm> <array> <cmath> <cstdint> <functional> <map> <memory> <optional> <span> <string>
    <string_view> <utility> <variant> <vector>)
function(etendue_precompiled_headers target)
    if(NOT ETENDUE_PCH)
        return()
    endif()
    target_precompile_headers(${target} ${ARGN})
    if(CMAKE_CXX_COMPILER_ID STREQUAL "GNU")
        target_compile_options(${target} PRIVATE -fpch-preprocess)  # for ccache
    else()
        target_compile_options(${target} PRIVATE "SHELL:-Xclang -fno-pch-timestamp")
    endif()
endfunction()

# etendue_layer(NAME [DEPENDS layers or targets...]): every *.cpp of the folder.
function(etendue_layer name)
    cmake_parse_arguments(ARG "" "" "DEPENDS;PRIVATE" ${ARGN})
    file(GLOB_RECURSE sources CONFIGURE_DEPENDS ${CMAKE_CURRENT_SOURCE_DIR}/${name}/*.cpp)
    set(include ${ETENDUE_LAYER_INCLUDES}/${name})
    file(MAKE_DIRECTORY ${include})
    file(CREATE_LINK ${CMAKE_CURRENT_SOURCE_DIR}/${name} ${include}/${name} SYMBOLIC)
    if(sources)
        add_library(${name} STATIC ${sources})
        target_include_directories(${name} PUBLIC ${include})
        target_link_libraries(${name} PUBLIC etendue_options ${ARG_DEPENDS} PRIVATE ${ARG_PRIVATE})
        get_property(first GLOBAL PROPERTY etendue_first_layer)
        if(first)
            etendue_precompiled_headers(${name} REUSE_FROM ${first})
        else()
            etendue_precompiled_headers(${name} PRIVATE ${ETENDUE_COMMON_HEADERS})
            set_property(GLOBAL PROPERTY etendue_first_layer ${name})
        endif()
    else()
        add_library(${name} INTERFACE)
        target_include_directories(${name} INTERFACE ${include})
        target_link_libraries(${name} INTERFACE etendue_options ${ARG_DEPENDS})
    endif()
endfunction()
