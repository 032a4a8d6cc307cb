# Builds the control TARGET in the build folder BUILD, then runs its PROGRAM with the one test FILTER, which finds the
# error. With FAILS, at least one of the tests that FILTER names must fail instead.
file(LOCK ${BUILD}/controls.lock GUARD PROCESS)  # Two concurrent builds would interfere.
execute_process(COMMAND ${CMAKE_COMMAND} --build ${BUILD} --target ${TARGET}
                RESULT_VARIABLE status OUTPUT_VARIABLE output ERROR_VARIABLE output)
file(LOCK ${BUILD}/controls.lock RELEASE)
if(NOT status EQUAL 0)
    message("${output}")
    message(FATAL_ERROR "${TARGET} cannot be built.")
endif()
execute_process(COMMAND ${PROGRAM} --gtest_filter=${FILTER} RESULT_VARIABLE status
                OUTPUT_VARIABLE output ECHO_OUTPUT_VARIABLE)
if(FAILS)
    if(status EQUAL 0 OR NOT output MATCHES "FAILED TEST")
        message(FATAL_ERROR "${TARGET}: the planted error was not found.")
    endif()
    return()
endif()
# A filter that matches no test would succeed.
if(NOT status EQUAL 0 OR NOT output MATCHES "PASSED  . 1 test\\.")
    message(FATAL_ERROR "${TARGET}: the planted error was not found as expected.")
endif()
