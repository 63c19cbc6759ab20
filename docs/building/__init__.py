"""What the documentation is made with: equations as MathML, pages made from the program itself."""
