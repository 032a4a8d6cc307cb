find_package(Threads REQUIRED)
find_package(TBB REQUIRED)
find_package(fmt REQUIRED)
find_package(pugixml REQUIRED)
find_package(OpenImageIO REQUIRED)
find_package(ZLIB REQUIRED)
find_package(nanoflann REQUIRED)
find_package(nlohmann_json REQUIRED)
find_package(Imath REQUIRED)
find_package(Boost REQUIRED)  # Boost.Math, header only
find_path(XXHASH_INCLUDE_DIR xxhash.h REQUIRED)

if(ETENDUE_PYTHON OR ETENDUE_TESTS OR ETENDUE_FUZZ)
    find_package(OpenEXR REQUIRED)
    find_package(PNG REQUIRED)
    find_package(JPEG REQUIRED)
endif()

# Debian 12 has Embree 3.13; the code also compiles with Embree 4.
find_package(embree 4 QUIET)
if(NOT embree_FOUND)
    find_package(embree 3.13 REQUIRED)
endif()
message(STATUS "Embree ${embree_VERSION}")
