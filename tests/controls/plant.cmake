# Writes COPY: the file ORIGINAL with each FROM_i, i < PAIRS, replaced by TO_i. Each FROM_i must be in it exactly once. Run
# by a script that sets these variables, see CMakeLists.txt.
include(${CMAKE_CURRENT_LIST_DIR}/expect_once.cmake)
file(READ ${ORIGINAL} text)
file(REMOVE ${COPY})
math(EXPR last "${PAIRS} - 1")
foreach(i RANGE ${last})
    expect_once(FATAL_ERROR ${NAME} ${ORIGINAL} "${text}" "${FROM_${i}}")
    string(REPLACE "${FROM_${i}}" "${TO_${i}}" text "${text}")
endforeach()
file(WRITE ${COPY} "${text}")
