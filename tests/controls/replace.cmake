# Writes the source file OBJECT: what the library's object with the file ORIGINAL is compiled from, with COPY in the place of
# ORIGINAL. GROUPS is the folder of the generated sources that include several, if there are any.
set(text "#include \"${ORIGINAL}\"\n")
file(GLOB groups ${GROUPS}/*)
foreach(group IN LISTS groups)
    file(READ ${group} several)
    string(FIND "${several}" "\"${ORIGINAL}\"" place)
    if(NOT place EQUAL -1)
        set(text "${several}")
    endif()
endforeach()
string(REPLACE "\"${ORIGINAL}\"" "\"${COPY}\"" text "${text}")
file(WRITE ${OBJECT} "${text}")
