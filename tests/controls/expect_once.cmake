# expect_once(MODE NAME FILE TEXT FROM): an error of this MODE (see message()) unless FROM is exactly once in TEXT, which is that of
# FILE. NAME: of the control.
function(expect_once mode name file text from)
    string(FIND "${text}" "${from}" first)
    string(FIND "${text}" "${from}" reverse REVERSE)
    if(first EQUAL -1 OR NOT first EQUAL reverse)
        message("control ${name}: expected exactly once in ${file}: ${from}")
        message(${mode} "The line was edited: update the control in tests/controls/CMakeLists.txt.")
    endif()
endfunction()
