// The page's template as it was built, in the library's constant data: an array in C++ would take seconds to compile.
        .section .rodata
        .global alidade_report_template
        .global alidade_report_template_end
alidade_report_template:
        .incbin ALIDADE_TEMPLATE_FILE
alidade_report_template_end:
        .byte 0
        .section .note.GNU-stack,"",%progbits
